//! What the layers of a glTF surface do at one direction, its wide lobes, and
//! with which probability each lobe is sampled.

use super::{Layered, Layers, ONE_MINUS_EPSILON, WAYS, Way};
use crate::bsdf::energy::{ANISOTROPIC_GGX, GGX, Split, schlick};
use crate::bsdf::energy_coat::{COAT_F0, COATS};
use crate::bsdf::mean;
use crate::bsdf::sheen::sheen_albedo;
use crate::math::{Rgb, Vec3};

/// The layers seen from one direction.
#[derive(Default)]
pub(super) struct View {
    pub outside: bool,
    /// The specular lobe of the base, without compensation.
    split: Split,
    /// f₀ of the largest channel of what it takes from the base.
    f0: f32,
    /// What the coat takes, its weight included.
    coat: f32,
    /// Loss of the coat's own first bounce.
    pub coat_loss: f32,
    /// Y of the coat, for A and B of the base.
    ratio: (f32, f32),
    /// What the sheen takes.
    sheen: f32,
    /// Albedo of white sheen, unscaled.
    pub sheen_albedo: f32,
    /// Loss of a solid's interface.
    glass: f32,
}

impl View {
    /// Factors on what lies under the coat and under the sheen.
    pub(super) fn under(&self, other: &View) -> (f32, f32) {
        (1.0 - self.coat.max(other.coat), 1.0 - self.sheen.max(other.sheen))
    }
}

/// Probabilities of the ways to sample.
pub(super) struct Shares {
    pub coat: f32,
    pub sheen: f32,
    pub interface: f32,
    pub up: f32,
    pub down: f32,
}

impl Shares {
    /// The way that `u` falls on, its probability, and `u` stretched over it.
    pub(super) fn choose(&self, u: f32) -> Option<(Way, f32, f32)> {
        let shares = [self.coat, self.sheen, self.interface, self.up, self.down];
        let mut start = 0.0;
        let mut last = None;
        for (way, share) in WAYS.into_iter().zip(shares) {
            if share > 0.0 {
                let place = ((u - start) / share).clamp(0.0, ONE_MINUS_EPSILON);
                last = Some((way, share, place));
                if u < start + share {
                    return last;
                }
            }
            start += share;
        }
        last
    }
}

impl Layered<'_> {
    /// The layers towards the direction `w` (w.z > 0) on the given side.
    pub(super) fn view(&self, w: Vec3, outside: bool) -> View {
        let rough = self.substance.roughness;
        let split = if self.distribution.is_delta() {
            Split { loss: 0.0, b: schlick(w.z) }
        } else if self.layers.anisotropy > 0.0 {
            ANISOTROPIC_GGX.at(w, self.roughness)
        } else {
            GGX.at(w.z, self.row)
        };
        let mut view =
            View { outside, split, f0: self.taken_from(w.z), ratio: (1.0, 1.0), ..View::default() };
        if let Some(table) = self.solid
            && !self.distribution.is_delta()
        {
            view.glass = table.loss(outside, w.z, rough, self.taken);
        }
        if !outside {
            return view;
        }
        let weight = self.layers.clearcoat;
        if weight > 0.0 {
            let coat = self.layers.clearcoat_roughness;
            let cos = w.dot(self.layers.clearcoat_normal);
            if cos > 0.0 {
                let own = if self.coat.is_delta() {
                    Split { loss: 0.0, b: schlick(cos) }
                } else {
                    GGX.at(cos.min(1.0), self.coat_row)
                };
                view.coat_loss = own.loss;
                view.coat = weight * (COAT_F0 * own.a() + own.b + self.coat_multiple.0 * own.loss);
            }
            view.ratio = COATS.ratio(w.z, rough, coat);
        }
        if self.sheen > 0.0 {
            view.sheen_albedo = sheen_albedo(w.z, self.layers.sheen_roughness);
            view.sheen = self.sheen * view.sheen_albedo.min(0.9999);
        }
        view
    }

    /// f₀ of the largest channel of the dielectric's reflectance from a direction.
    fn taken_from(&self, cos: f32) -> f32 {
        let Layers { iridescence, film, .. } = self.layers;
        if !(iridescence > 0.0 && self.blurred < 1.0 && self.substance.metallic < 1.0) {
            return self.taken.0;
        }
        let plain = self.substance.f0;
        let here = film.schlick_f0(cos, plain) - plain.max_element();
        let here = plain.max_element() + here * iridescence;
        here + (self.taken.0 - here) * self.blurred
    }

    /// L: what the specular part loses for good to more than one bounce.
    fn lost(&self, v: &View) -> f32 {
        let kept = v.split.a() * v.ratio.0 + v.split.b * v.ratio.1;
        (v.split.loss - v.coat * (1.0 - kept)).max(0.0)
    }

    /// T: what coat and specular part leave for the base.
    fn passed(&self, v: &View, lost: f32) -> f32 {
        let (f0, f90) = (v.f0, self.taken.1);
        let a = f0 * v.split.a() * (1.0 - v.coat * v.ratio.0);
        let b = f90 * v.split.b * (1.0 - v.coat * v.ratio.1);
        (1.0 - v.coat - a - b - self.multiple.0 * lost).max(0.0)
    }

    /// Albedos of the diffuse base: reflected, transmitted.
    fn diffuse(&self) -> (Rgb, Rgb) {
        let layers = &self.layers;
        let opaque = (1.0 - self.substance.metallic) * (1.0 - layers.transmission);
        let through = opaque * layers.diffuse_transmission;
        (self.substance.base_color * (opaque - through), layers.diffuse_transmission_color * through)
    }

    /// Share of the surface whose lost light comes back as that of a metal.
    fn not_glass(&self) -> f32 {
        if self.solid.is_some() { 1.0 - self.clear() } else { 1.0 }
    }

    /// The wide lobes in reflection over cos θi, without the sheen's factor.
    pub(super) fn wide_above(&self, o: &View, i: &View) -> Rgb {
        let mut value = Rgb::ZERO;
        if o.outside {
            let (lost_o, lost_i) = (self.lost(o), self.lost(i));
            value += self.multiple.1 * (self.not_glass() * lost_o * lost_i * self.scale.0);
            let reflected = self.diffuse().0;
            if reflected != Rgb::ZERO {
                value += reflected * (self.passed(o, lost_o) * self.passed(i, lost_i) * self.scale.1);
            }
        }
        if self.solid.is_some() {
            let side = usize::from(!o.outside);
            let share = self.clear() * (1.0 - self.glass.transmitted[side]);
            let norm = std::f32::consts::PI * self.glass.loss[side].max(1e-9);
            value += Rgb::splat(share * o.glass * i.glass * o.under(i).0 / norm);
        }
        value
    }

    /// The same in transmission, radiance scaling included.
    pub(super) fn wide_below(&self, o: &View, i: &View) -> Rgb {
        let mut value = Rgb::ZERO;
        if self.solid.is_some() {
            let (side, other) = if o.outside { (0, 1) } else { (1, 0) };
            let eta = if o.outside { self.eta() } else { 1.0 / self.eta() };
            let norm = std::f32::consts::PI * self.glass.loss[other].max(1e-9) * eta * eta;
            let share = self.clear() * self.glass.transmitted[side];
            value += self.substance.base_color * (share * o.glass * i.glass * o.under(i).0 / norm);
            // Diffuse light is spread evenly inside.
            let (outer, scale) = if o.outside { (o, 1.0 / (eta * eta)) } else { (i, 1.0) };
            let passed = self.passed(outer, self.lost(outer));
            return value + self.diffuse().1 * (passed * scale * std::f32::consts::FRAC_1_PI);
        }
        let (lost_o, lost_i) = (self.lost(o), self.lost(i));
        if self.clear() > 0.0 {
            let open = self.clear() * (1.0 - self.multiple.0);
            value += self.substance.base_color * (open * lost_o * lost_i * self.scale.0);
        }
        let transmitted = self.diffuse().1;
        if transmitted != Rgb::ZERO {
            value += transmitted * (self.passed(o, lost_o) * self.passed(i, lost_i) * self.scale.1);
        }
        value
    }

    /// What each way returns in all.
    fn returns(&self, v: &View) -> [Rgb; 5] {
        let (f0, f90) = self.mixed;
        let split = v.split;
        let (bound, f90_bound) = self.taken;
        let open = (1.0 - bound) * split.a() + (1.0 - f90_bound) * split.b;
        let clear = self.clear();
        let tint = self.substance.base_color;
        let side = usize::from(!v.outside);
        let glass = if self.solid.is_some() { clear * v.glass } else { 0.0 };
        let back = Rgb::splat(glass * (1.0 - self.glass.transmitted[side]));
        let through = tint * (glass * self.glass.transmitted[side]);
        if !v.outside {
            let interface = Rgb::splat(clear * (1.0 - v.glass));
            return [Rgb::ZERO, Rgb::ZERO, interface, back, through + self.diffuse().1];
        }
        let (coat, sheen) = (1.0 - v.coat, 1.0 - v.sheen);
        let lost = self.lost(v);
        let passed = self.passed(v, lost);
        let (up, down) = self.diffuse();
        let hazy = if self.solid.is_some() { 0.0 } else { clear * (1.0 - self.multiple.0) };
        let sheen_color = self.layers.sheen_color * (v.sheen / self.sheen.max(1e-9));
        [
            Rgb::splat(v.coat),
            sheen_color * coat,
            (f0 * split.a() + f90 * split.b + tint * (clear * open)) * (coat * sheen),
            (self.multiple.1 * (self.not_glass() * lost) + up * passed + back) * sheen,
            (down * passed + tint * (hazy * lost) + through) * sheen,
        ]
    }

    /// Probabilities of the ways to sample; `None` where nothing is returned.
    pub(super) fn shares(&self, v: &View, outside: bool) -> Option<Shares> {
        debug_assert_eq!(outside, v.outside);
        let [coat, sheen, interface, up, down] = self.returns(v).map(mean);
        let all = coat + sheen + interface + up + down;
        if !(all > 0.0) {
            return None;
        }
        Some(Shares {
            coat: coat / all,
            sheen: sheen / all,
            interface: interface / all,
            up: up / all,
            down: down / all,
        })
    }

    /// What is returned in all, about.
    pub(super) fn albedo_of(&self, v: &View) -> Rgb {
        self.returns(v).into_iter().sum::<Rgb>().min(Rgb::ONE)
    }
}
