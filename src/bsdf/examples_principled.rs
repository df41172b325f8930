//! Examples of Mitsuba's principled surfaces: each lobe alone and all
//! together.

use std::sync::LazyLock;

use super::examples::Named;
use super::{Principled, PrincipledBase, PrincipledThin};
use crate::math::Rgb;

const BASE: PrincipledBase = PrincipledBase::DEFAULT;

const ALL: PrincipledBase = PrincipledBase {
    base_color: Rgb::new(0.8, 0.4, 0.2),
    anisotropic: 0.5,
    spec_trans: 0.4,
    spec_tint: 0.3,
    sheen: 0.6,
    sheen_tint: 0.5,
    flatness: 0.5,
    ..BASE
};

const PLAIN: Principled =
    Principled { base: BASE, metallic: 0.0, clearcoat: 0.0, clearcoat_gloss: 0.0, rates: [1.0; 3] };

const SHEET: PrincipledThin = PrincipledThin { base: BASE, diff_trans: 0.0, rates: [1.0; 4] };

pub(super) fn push(list: &mut Named) {
    static SOLID: LazyLock<Vec<(&str, Principled)>> = LazyLock::new(solids);
    static THIN: LazyLock<Vec<(&str, PrincipledThin)>> = LazyLock::new(sheets);
    list.extend(SOLID.iter().map(|(name, surface)| (format!("principled {name}"), surface.into())));
    list.extend(THIN.iter().map(|(name, surface)| (format!("principledthin {name}"), surface.into())));
}

fn solids() -> Vec<(&'static str, Principled)> {
    let base = |base: PrincipledBase| Principled { base, ..PLAIN };
    vec![
        ("plain", PLAIN),
        ("black", base(PrincipledBase { base_color: Rgb::ZERO, ..BASE })),
        ("sharp", base(PrincipledBase { roughness: 0.05, ..BASE })),
        ("metal", Principled { metallic: 1.0, ..base(ALL) }),
        ("coated", Principled { clearcoat: 1.0, clearcoat_gloss: 0.3, ..PLAIN }),
        ("velvet", base(PrincipledBase { sheen: 1.0, flatness: 1.0, roughness: 1.0, ..BASE })),
        ("glass", base(PrincipledBase { base_color: Rgb::ONE, spec_trans: 1.0, roughness: 0.4, ..BASE })),
        ("bubble", base(PrincipledBase { spec_trans: 0.7, eta: 0.8, ..BASE })),
        ("of everything", Principled { metallic: 0.3, clearcoat: 0.5, clearcoat_gloss: 0.5, ..base(ALL) }),
    ]
}

fn sheets() -> Vec<(&'static str, PrincipledThin)> {
    vec![
        ("plain", SHEET),
        ("paper", PrincipledThin { diff_trans: 1.2, ..SHEET }),
        ("pane", PrincipledThin { base: PrincipledBase { spec_trans: 1.0, ..BASE }, ..SHEET }),
        ("of everything", PrincipledThin { base: ALL, diff_trans: 0.7, rates: [1.0, 0.5, 2.0, 1.0] }),
    ]
}
