//! The whole glTF surface: clear coat over sheen over metal, diffuse base,
//! specular and diffuse transmission, with iridescence and anisotropy.
//!
//! From the top: f = c·f_coat + g_c·(f_sheen + g_s·f_base), the factors
//! g = 1 − max over both directions of what the layer takes (`KHR_materials_
//! sheen` says so of sheen; for the coat see `energy_coat.rs`), which is the
//! same both ways and never lets out more than came in. The wide lobes of the
//! base are weighed by what the coat and the specular part leave of both
//! directions, so that a coat over a white base loses nothing.
//!
//! A thin wall transmits the mirror image of its specular lobe and looks the
//! same from both sides. A solid refracts by Walter et al. 2007 with Schlick's
//! reflectance of the rarer side; its inside is the bare interface.
//!
//! All of it lies in one frame. Under a normal map that is the map's: a coat of
//! another normal is cut off where the mapped base turns away, and dimmed by the
//! map's terminator, though it has a normal of its own.
//!
//! Not free of loss: sheen (by the rule above), iridescence on a diffuse base
//! (weighed by its brightest channel from that direction; from α = 0.1 up by a
//! bound for all directions, which takes more), a rough solid of another index than
//! its table (by dispersion; 0.5 % of blue at an Abbe number of 20), a coat on a solid seen from inside,
//! a coat with an anisotropic base (up to 1 %).

mod shares;

use std::f32::consts::FRAC_1_PI;

use self::shares::{Shares, View};
use super::BsdfSample;
use super::energy::{ANISOTROPIC_GGX, GGX, Row, multiple, schlick};
use super::energy_coat::{COAT_F0, COATS, coat_multiple};
use super::energy_glass::{GlassMeans, GlassTable};
use super::film::{Film, Survey};
use super::fresnel::reflect;
use super::mean;
use super::metal_rough::Substance;
use super::microfacet::{ALPHA_MIN, Distribution, Microfacet, unit};
use super::rough_conductor::reflection_terms;
use super::rough_dielectric::{Refraction, refraction};
use super::sheen::{sheen, uniform_hemisphere};
use crate::math::{Frame, ONE_MINUS_EPSILON, Rgb, Vec2, Vec3};
use crate::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};

/// The α from which facets mix the colours that a film has from all directions.
const FILM_BLUR: f32 = 0.1;
/// What the mean of what passes a film may be off by, of itself.
const FILM_SLACK: f32 = 5e-3;

/// What may lie on a glTF surface and what may pass through it; every part is
/// absent at its default.
#[derive(Clone, Copy, Debug)]
pub struct Layers {
    /// Stretch of the specular lobe along x, [0, 1].
    pub anisotropy: f32,
    /// Share of the surface that the film covers, and the film.
    pub iridescence: f32,
    /// See `iridescence`.
    pub film: Film,
    /// Weight of the coat, [0, 1].
    pub clearcoat: f32,
    /// √α of the coat, [0, 1].
    pub clearcoat_roughness: f32,
    /// Unit normal of the coat in the local frame.
    pub clearcoat_normal: Vec3,
    /// Colour of the sheen, [0, 1].
    pub sheen_color: Rgb,
    /// √α of the sheen, [0, 1].
    pub sheen_roughness: f32,
    /// Share of the dielectric that is clear instead of diffuse, [0, 1].
    pub transmission: f32,
    /// Share of the diffuse base that lets light through, [0, 1].
    pub diffuse_transmission: f32,
    /// Colour of that light, [0, 1].
    pub diffuse_transmission_color: Rgb,
}

impl Default for Layers {
    fn default() -> Layers {
        Layers {
            anisotropy: 0.0,
            iridescence: 0.0,
            film: Film { ior: 1.3, thickness: 400.0 },
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            clearcoat_normal: Vec3::Z,
            sheen_color: Rgb::ZERO,
            sheen_roughness: 0.0,
            transmission: 0.0,
            diffuse_transmission: 0.0,
            diffuse_transmission_color: Rgb::ONE,
        }
    }
}

/// A glTF surface with any of its layers.
#[derive(Clone, Copy, Debug)]
pub struct Layered<'a> {
    substance: Substance,
    layers: Layers,
    solid: Option<&'a GlassTable>,
    /// η of the inside over the outside; 1 for a thin wall.
    eta: f32,
    two_sided: bool,
    distribution: Microfacet,
    /// √α along x and y.
    roughness: Vec2,
    row: Row,
    coat: Microfacet,
    coat_row: Row,
    /// F̂ of the coat, and 1/(π⟨loss⟩).
    coat_multiple: (f32, f32),
    /// Largest channel of the dielectric's reflectance from all directions, and its f₉₀.
    taken: (f32, f32),
    /// How far, from 0 to 1, facets spread over the colours of a film.
    blurred: f32,
    /// Schlick's f₀ and f₉₀ of dielectric and metal together, about.
    mixed: (Rgb, f32),
    /// F̂ of the dielectric's largest channel, and of the whole.
    multiple: (f32, Rgb),
    /// 1/(π⟨L⟩) and 1/(π⟨T⟩): scales of the wide lobes.
    scale: (f32, f32),
    glass: GlassMeans,
    /// Largest channel of the sheen.
    sheen: f32,
}

/// The ways to sample, in the order in which the lobe sample passes them.
#[derive(Clone, Copy)]
enum Way {
    Coat,
    Sheen,
    Interface,
    Up,
    Down,
}

const WAYS: [Way; 5] = [Way::Coat, Way::Sheen, Way::Interface, Way::Up, Way::Down];

impl<'a> Layered<'a> {
    /// A surface of `substance` with `layers`. `solid` is the table of the
    /// index of refraction behind a closed surface, `None` for a thin wall.
    /// A thin wall that transmits looks the same from both sides anyway;
    /// `two_sided` makes an opaque one do so.
    #[must_use]
    pub fn new(
        substance: &Substance,
        layers: &Layers,
        solid: Option<&'a GlassTable>,
        two_sided: bool,
    ) -> Layered<'a> {
        let (substance, layers) = (*substance, *layers);
        let rough = if substance.roughness > 0.0 { substance.roughness.min(1.0) } else { 0.0 };
        let alpha = rough * rough;
        let stretched = alpha + (1.0 - alpha) * layers.anisotropy * layers.anisotropy;
        let coat_alpha = layers.clearcoat_roughness * layers.clearcoat_roughness;
        let transmits = layers.transmission > 0.0 || layers.diffuse_transmission > 0.0;
        let clear = layers.transmission > 0.0 && substance.metallic < 1.0;
        let mut surface = Layered {
            substance: Substance { roughness: rough, ..substance },
            layers,
            solid: solid.filter(|_| clear),
            eta: solid.filter(|_| clear).map_or(1.0, GlassTable::eta),
            two_sided: two_sided || (transmits && !(solid.is_some() && clear)),
            distribution: Microfacet::new(Distribution::Ggx, stretched, alpha),
            roughness: Vec2::new(stretched.sqrt(), rough),
            coat: Microfacet::new(Distribution::Ggx, coat_alpha, coat_alpha),
            row: Row::new(rough),
            coat_row: Row::new(layers.clearcoat_roughness),
            coat_multiple: (0.0, 0.0),
            taken: (substance.f0.max_element(), substance.f90),
            blurred: (stretched / FILM_BLUR).min(1.0),
            mixed: substance.schlick_terms(),
            multiple: (0.0, Rgb::ZERO),
            scale: (0.0, 0.0),
            glass: GlassMeans::default(),
            sheen: layers.sheen_color.max_element(),
        };
        surface.compensate();
        surface
    }

    /// The same with another index inside, near that of its table: it refracts
    /// by it, and everything else stays.
    #[must_use]
    pub fn refracting(self, eta: f32) -> Layered<'a> {
        Layered { eta: if self.solid.is_some() { eta } else { self.eta }, ..self }
    }

    /// Fills in what does not depend on directions.
    fn compensate(&mut self) {
        let Substance { base_color, metallic, f0, mut f90, .. } = self.substance;
        let (mut dielectric, mut metal) = (f0, base_color);
        let mut mean_f0 = self.taken.0;
        if self.layers.iridescence > 0.0 {
            let blend = |plain: Rgb, film: Rgb| plain + (film - plain) * self.layers.iridescence;
            let Survey { most, mean, colour } = self.layers.film.survey(f0);
            let mean = mean + (most - mean) * self.blurred;
            mean_f0 += (mean - mean_f0) * self.layers.iridescence;
            self.taken.0 += (most - self.taken.0) * self.layers.iridescence;
            // At grazing angles a film reflects everything.
            f90 += (1.0 - f90) * self.layers.iridescence;
            self.taken.1 = f90;
            self.mixed.1 = f90 * (1.0 - metallic) + metallic;
            dielectric = blend(f0, colour);
            metal = blend(base_color, self.layers.film.survey(base_color).colour);
            self.mixed.0 = dielectric * (1.0 - metallic) + metal * metallic;
        }
        let rough = self.substance.roughness;
        let average =
            if self.layers.anisotropy > 0.0 { ANISOTROPIC_GGX.mean(self.roughness) } else { GGX.mean(rough) };
        let hat = multiple(dielectric, f90, average.loss);
        let bound = multiple(Rgb::splat(self.taken.0), self.taken.1, average.loss).x;
        self.multiple = (bound, hat * (1.0 - metallic) + multiple(metal, 1.0, average.loss) * metallic);

        let (f0, f90) = (mean_f0, self.taken.1);
        let c = self.layers.clearcoat;
        let (mut loss, mut passed) = (average.loss, 1.0 - f0 * average.a() - f90 * average.b);
        if c > 0.0 {
            let coat = self.layers.clearcoat_roughness;
            self.coat_multiple = (coat_multiple(coat), FRAC_1_PI / GGX.mean(coat).loss.max(1e-9));
            let means = COATS.means(rough, coat);
            loss -= c * (means.coat - means.a - means.b);
            passed -= c * (means.coat - f0 * means.a - f90 * means.b);
        }
        passed -= bound * loss;
        passed *= 1.0 + FILM_SLACK * self.layers.iridescence;
        self.scale = (FRAC_1_PI / loss.max(1e-9), FRAC_1_PI / passed.max(1e-9));
        if let Some(table) = self.solid {
            self.glass = table.means(rough, self.taken);
        }
    }

    /// True when all that is left are mirrors and panes.
    pub(super) fn is_delta_only(&self) -> bool {
        let Layers { transmission, clearcoat, .. } = self.layers;
        let clear = transmission >= 1.0 || self.substance.metallic >= 1.0;
        self.distribution.is_delta()
            && clear
            && self.sheen == 0.0
            && (clearcoat == 0.0 || self.coat.is_delta())
    }

    /// Light goes through, other than as if nothing were there.
    pub(super) fn transmits(&self) -> bool {
        self.layers.transmission > 0.0 || self.layers.diffuse_transmission > 0.0
    }

    pub(super) fn is_one_sided(&self) -> bool {
        !self.two_sided && self.solid.is_none()
    }

    /// η of the inside over the outside; 1 for a thin wall.
    #[must_use]
    pub fn eta(&self) -> f32 {
        self.eta
    }

    /// Share of the surface that is clear.
    fn clear(&self) -> f32 {
        (1.0 - self.substance.metallic) * self.layers.transmission
    }

    /// Reflectance of the dielectric and of the whole at a facet.
    fn reflectance(&self, cos: f32) -> (Rgb, Rgb) {
        let Substance { base_color, metallic, f0, f90, .. } = self.substance;
        let s = schlick(cos);
        let mut dielectric = f0 * (1.0 - s) + f90 * s;
        let mut metal = if metallic > 0.0 { base_color * (1.0 - s) + s } else { Rgb::ZERO };
        let Layers { iridescence, film, .. } = self.layers;
        if iridescence > 0.0 {
            if metallic < 1.0 {
                // The strength of the reflection is in f₀, and does not weigh a film.
                let shine = film.reflectance(cos, f0);
                dielectric += (shine - dielectric) * iridescence;
            }
            if metallic > 0.0 {
                metal += (film.reflectance(cos, base_color) - metal) * iridescence;
            }
        }
        (dielectric, dielectric * (1.0 - metallic) + metal * metallic)
    }

    /// What a facet reflects and what it transmits, seen from above.
    fn facet(&self, cos: f32) -> (Rgb, Rgb) {
        let (dielectric, all) = self.reflectance(cos);
        let open = (1.0 - dielectric.max_element()).max(0.0) * self.clear();
        (all, self.substance.base_color * open)
    }

    /// The same from inside a solid; total reflection takes the clear share.
    fn facet_inside(&self, cos: f32) -> (Rgb, Rgb) {
        let clear = self.clear();
        match rarer_cosine(cos, 1.0 / self.eta()) {
            None => (Rgb::splat(clear), Rgb::ZERO),
            Some(cos) => {
                let dielectric = self.reflectance(cos).0;
                let open = (1.0 - dielectric.max_element()).max(0.0) * clear;
                (dielectric * clear, self.substance.base_color * open)
            }
        }
    }

    /// What a facet does seen from the given side of the surface.
    fn facet_from(&self, outside: bool, cos: f32) -> (Rgb, Rgb) {
        if !outside {
            return self.facet_inside(cos);
        }
        match self.solid {
            Some(_) if self.eta < 1.0 => match rarer_cosine(cos, self.eta) {
                Some(cos) => self.facet(cos),
                None => {
                    (Rgb::splat(self.clear()) + self.reflectance(0.0).1 * (1.0 - self.clear()), Rgb::ZERO)
                }
            },
            _ => self.facet(cos),
        }
    }

    fn transmits_delta(&self) -> bool {
        let eta = self.eta();
        self.solid.is_some() && {
            let width = self.distribution.alpha().max_element() * (eta - 1.0).abs() / eta.max(1.0);
            width < ALPHA_MIN
        } || self.distribution.is_delta()
    }

    /// Both directions turned so that `wo` is up, where that side looks the
    /// same; with whether `wo` is outside.
    fn turned(&self, wo: Vec3) -> Option<(f32, bool)> {
        if wo.z > 0.0 {
            Some((1.0, true))
        } else if !(wo.z < 0.0) {
            None
        } else if self.solid.is_some() {
            Some((-1.0, false))
        } else {
            self.two_sided.then_some((-1.0, true))
        }
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let Some((sign, outside)) = self.turned(wo) else { return (Rgb::ZERO, 0.0) };
        let (wo, wi) = (wo * sign, wi * sign);
        let here = self.view(wo, outside);
        let Some(shares) = self.shares(&here, outside) else { return (Rgb::ZERO, 0.0) };
        if wi.z > 0.0 {
            self.above(wo, wi, &here, &shares)
        } else if wi.z < 0.0 {
            self.below(wo, wi, &here, &shares)
        } else {
            (Rgb::ZERO, 0.0)
        }
    }

    /// Reflection; both directions up, on the side of `here`.
    fn above(&self, wo: Vec3, wi: Vec3, here: &View, shares: &Shares) -> (Rgb, f32) {
        let outside = here.outside;
        let there = self.view(wi, outside);
        let (under_coat, under_sheen) = here.under(&there);
        let mut value = self.wide_above(here, &there) * (wi.z * under_sheen);
        let mut pdf = shares.up * cosine_hemisphere_pdf(wi.z);
        if !self.distribution.is_delta() {
            let m = unit(wo + wi);
            let (reflected, transmitted) = self.facet_from(outside, wo.dot(m));
            let (shape, density) = reflection_terms(&self.distribution, wo, wi, m);
            value += reflected * (shape * under_coat * under_sheen);
            pdf += shares.interface * reflecting(reflected, transmitted) * density;
        }
        if outside && self.sheen > 0.0 {
            let albedos = (here.sheen_albedo, there.sheen_albedo);
            let white = sheen(wo, wi, self.layers.sheen_roughness, albedos);
            value += self.layers.sheen_color * (white * under_coat);
            pdf += shares.sheen * 0.5 * FRAC_1_PI;
        }
        if outside && self.layers.clearcoat > 0.0 {
            let (coat, density) = self.coat_terms(wo, wi, here, &there);
            value += coat;
            pdf += shares.coat * density;
        }
        (value, pdf)
    }

    /// Value of the coat and density of its specular lobe.
    fn coat_terms(&self, wo: Vec3, wi: Vec3, here: &View, there: &View) -> (Rgb, f32) {
        let frame = Frame::from_normal(self.layers.clearcoat_normal);
        let (o, i) = (frame.to_local(wo), frame.to_local(wi));
        if !(o.z > 0.0 && i.z > 0.0) {
            return (Rgb::ZERO, 0.0);
        }
        let (hat, scale) = self.coat_multiple;
        let wide = hat * here.coat_loss * there.coat_loss * scale * i.z;
        let (mut value, mut density) = (wide, 0.0);
        if !self.coat.is_delta() {
            let m = unit(o + i);
            let s = schlick(o.dot(m));
            let (shape, d) = reflection_terms(&self.coat, o, i, m);
            value += (COAT_F0 + (1.0 - COAT_F0) * s) * shape;
            density = d;
        }
        (Rgb::splat(value * self.layers.clearcoat), density)
    }

    /// Transmission; `wo` up and `wi` down.
    fn below(&self, wo: Vec3, wi: Vec3, here: &View, shares: &Shares) -> (Rgb, f32) {
        let there = self.view(-wi, self.solid.is_none() || !here.outside);
        let (under_coat, under_sheen) = here.under(&there);
        let mut value = self.wide_below(here, &there) * (-wi.z * under_sheen);
        let mut pdf = shares.down * cosine_hemisphere_pdf(-wi.z);
        if self.transmits_delta() || self.clear() == 0.0 {
            return (value, pdf);
        }
        let (cos, shape, density) = if self.solid.is_some() {
            let eta = if here.outside { self.eta() } else { 1.0 / self.eta() };
            let Some(Refraction { m, wo_m, wi_m_over_h2 }) = refraction(wo, wi, eta) else {
                return (value, pdf);
            };
            let common = self.distribution.d(m) * wo_m * wi_m_over_h2;
            let over_cos = common * self.distribution.g1_over_cos(wo);
            (wo_m, over_cos * self.distribution.g1(wi), over_cos * eta * eta)
        } else {
            let mirrored = Vec3::new(wi.x, wi.y, -wi.z);
            let m = unit(wo + mirrored);
            let (shape, density) = reflection_terms(&self.distribution, wo, mirrored, m);
            (wo.dot(m), shape, density)
        };
        let (reflected, transmitted) = self.facet_from(here.outside, cos);
        value += transmitted * (shape * under_coat * under_sheen);
        pdf += shares.interface * (1.0 - reflecting(reflected, transmitted)) * density;
        (value, pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (sign, outside) = self.turned(wo)?;
        let up = wo * sign;
        let here = self.view(up, outside);
        let shares = self.shares(&here, outside)?;
        let (way, share, u_lobe) = shares.choose(u_lobe)?;
        let wi = match way {
            Way::Interface => return self.sample_interface(up, &here, (share, u_lobe), u, sign),
            Way::Coat => {
                let frame = Frame::from_normal(self.layers.clearcoat_normal);
                let o = frame.to_local(up);
                if !(o.z > 0.0) {
                    return None;
                }
                let m = self.coat.sample(o, u);
                let i = reflect(o, m);
                let wi = frame.to_world(i);
                if !(i.z > 0.0 && wi.z > 0.0) {
                    return None;
                }
                if self.coat.is_delta() {
                    let f = COAT_F0 + (1.0 - COAT_F0) * schlick(o.dot(m));
                    let weight = self.layers.clearcoat * f * self.coat.g1(i) / share;
                    return BsdfSample::delta(wi * sign, Rgb::splat(weight), share);
                }
                wi
            }
            Way::Sheen => uniform_hemisphere(u),
            Way::Up => cosine_hemisphere(u),
            Way::Down => -cosine_hemisphere(u),
        };
        self.finished(up, wi, &here, &shares, sign)
    }

    /// The sample of a direction from the density of all lobes.
    fn finished(&self, up: Vec3, wi: Vec3, here: &View, shares: &Shares, sign: f32) -> Option<BsdfSample> {
        let (value, pdf) =
            if wi.z > 0.0 { self.above(up, wi, here, shares) } else { self.below(up, wi, here, shares) };
        let eta = match self.solid {
            Some(_) if wi.z < 0.0 => {
                if here.outside {
                    self.eta
                } else {
                    1.0 / self.eta
                }
            }
            _ => 1.0,
        };
        BsdfSample::smooth(wi * sign, value / pdf, pdf).map(|s| BsdfSample { eta, ..s })
    }

    /// Reflection or transmission by a facet; `share` is the probability of
    /// coming here.
    fn sample_interface(
        &self,
        up: Vec3,
        here: &View,
        (share, u_lobe): (f32, f32),
        u: Vec2,
        sign: f32,
    ) -> Option<BsdfSample> {
        let m = self.distribution.sample(up, u);
        let cos = up.dot(m);
        let (reflected, transmitted) = self.facet_from(here.outside, cos);
        let p = reflecting(reflected, transmitted);
        let shares = self.shares(here, here.outside)?;
        if u_lobe < p {
            let wi = reflect(up, m);
            if !(wi.z > 0.0) {
                return None;
            }
            if !self.distribution.is_delta() {
                return self.finished(up, wi, here, &shares, sign);
            }
            let (coat, sheen) = here.under(&self.view(wi, here.outside));
            let weight = reflected * (self.distribution.g1(wi) * coat * sheen / (p * share));
            return BsdfSample::delta(wi * sign, weight, p * share);
        }
        let eta = if here.outside { self.eta() } else { 1.0 / self.eta() };
        let wi = if self.solid.is_none() {
            let r = reflect(up, m);
            Vec3::new(r.x, r.y, -r.z)
        } else if eta == 1.0 {
            -up
        } else {
            let cos2 = 1.0 - (1.0 - cos * cos) / (eta * eta);
            unit(m * (cos / eta - cos2.max(0.0).sqrt()) - up / eta)
        };
        if !(wi.z < 0.0) {
            return None;
        }
        if !self.transmits_delta() {
            return self.finished(up, wi, here, &shares, sign);
        }
        let there = self.view(-wi, self.solid.is_none() || !here.outside);
        let (coat, sheen) = here.under(&there);
        let p = (1.0 - p) * share;
        // Without a bend there is nothing rough to be shadowed by.
        let shadow = if self.solid.is_some() && eta == 1.0 { 1.0 } else { self.distribution.g1(wi) };
        let weight = transmitted * (shadow * coat * sheen / (eta * eta * p));
        BsdfSample::delta(wi * sign, weight, p).map(|s| BsdfSample { eta, ..s })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        let Some((sign, outside)) = self.turned(wo) else { return Rgb::ZERO };
        self.albedo_of(&self.view(wo * sign, outside))
    }
}

/// The cosine of a facet on the rarer side, seen from the denser at `cos`;
/// `eta` is that of the far side over the near one. `None` under total
/// reflection.
fn rarer_cosine(cos: f32, eta: f32) -> Option<f32> {
    if eta >= 1.0 {
        return Some(cos);
    }
    let cos2 = 1.0 - (1.0 - cos * cos) / (eta * eta);
    (cos2 > 0.0).then(|| cos2.sqrt())
}

/// Probability of reflection at a facet.
fn reflecting(reflected: Rgb, transmitted: Rgb) -> f32 {
    let (r, t) = (mean(reflected), mean(transmitted));
    if r + t > 0.0 { r / (r + t) } else { 1.0 }
}
