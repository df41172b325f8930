//! What a sample carries and which of it the film keeps.

use super::groups::{Groups, PER_GROUP};
use super::tile::Limits;
use crate::math::{Rgb, Vec2, Vec3};

/// Which layers a film keeps beside R, G, B. What is off costs nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LayerSet {
    /// `A`: coverage, filtered.
    pub alpha: bool,
    /// `albedo.R/G/B`, filtered.
    pub albedo: bool,
    /// `N.X/Y/Z`, filtered.
    pub normal: bool,
    /// `P.X/Y/Z`, filtered.
    pub position: bool,
    /// `Z`: the closest of the samples in the pixel, not filtered; infinite
    /// where nothing was hit.
    pub depth: bool,
    /// `m2.R/G/B`: mean square of the radiance of single samples, filtered.
    pub moment: bool,
    /// `forward.u/v`: how many pixels the first surface moves to the right and
    /// down from the opening of the shutter to its end, filtered.
    pub motion: bool,
    /// `bad`: how many samples of the pixel were left out, not filtered.
    pub bad: bool,
    /// `error.R/G/B`: standard error of the mean.
    pub error: bool,
}

impl LayerSet {
    /// All layers.
    pub const ALL: LayerSet = LayerSet {
        alpha: true,
        albedo: true,
        normal: true,
        position: true,
        depth: true,
        moment: true,
        motion: true,
        bad: true,
        error: true,
    };

    /// The layers of either.
    #[must_use]
    pub fn or(self, other: LayerSet) -> LayerSet {
        LayerSet {
            alpha: self.alpha | other.alpha,
            albedo: self.albedo | other.albedo,
            normal: self.normal | other.normal,
            position: self.position | other.position,
            depth: self.depth | other.depth,
            moment: self.moment | other.moment,
            motion: self.motion | other.motion,
            bad: self.bad | other.bad,
            error: self.error | other.error,
        }
    }

    /// True when some layer shows what the first hit decides.
    #[must_use]
    pub fn needs_first_hit(self) -> bool {
        self.albedo || self.normal || self.position || self.depth || self.motion
    }
}

/// One camera sample. Everything but `depth` must be finite, and `rgb` must
/// not be negative: whoever traces it counts and drops the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelSample {
    /// Radiance.
    pub rgb: Rgb,
    /// Coverage: 0 where the ray left the scene.
    pub alpha: f32,
    /// Reflectance of the first surface; 0 where there is none.
    pub albedo: Rgb,
    /// Shading normal of the first surface; 0 where there is none.
    pub normal: Vec3,
    /// Position of the first surface; 0 where there is none.
    pub position: Vec3,
    /// Distance of the first surface; infinite where there is none.
    pub depth: f32,
    /// Pixels that the first surface moves; 0 where there is none.
    pub motion: Vec2,
}

impl Default for PixelSample {
    /// A black sample that hit nothing.
    fn default() -> Self {
        PixelSample {
            rgb: Rgb::ZERO,
            alpha: 0.0,
            albedo: Rgb::ZERO,
            normal: Vec3::ZERO,
            position: Vec3::ZERO,
            depth: f32::INFINITY,
            motion: Vec2::ZERO,
        }
    }
}

impl PixelSample {
    /// True when every summed value is finite and the radiance not negative.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.rgb.is_finite()
            && self.rgb.min_element() >= 0.0
            && self.alpha.is_finite()
            && self.albedo.is_finite()
            && self.normal.is_finite()
            && self.position.is_finite()
            && self.motion.is_finite()
            && !self.depth.is_nan()
    }
}

/// Most values in one pixel beyond the groups.
pub(super) const MAX_EXTRAS: usize = 15;

/// Where the sums of a pixel lie: the groups, then the other layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub groups: Groups,
    /// Where the other layers begin.
    pub extras: usize,
    pub stride: usize,
    pub alpha: Option<usize>,
    pub albedo: Option<usize>,
    pub normal: Option<usize>,
    pub position: Option<usize>,
    pub moment: Option<usize>,
    pub motion: Option<usize>,
}

impl Layout {
    pub fn new(layers: LayerSet, groups: Groups) -> Layout {
        let extras = groups.count() * PER_GROUP;
        let mut stride = extras;
        let mut take = |wanted: bool, count: usize| {
            let at = stride;
            wanted.then(|| stride += count).map(|()| at)
        };
        let alpha = take(layers.alpha, 1);
        let albedo = take(layers.albedo, 3);
        let normal = take(layers.normal, 3);
        let position = take(layers.position, 3);
        let moment = take(layers.moment, 3);
        let motion = take(layers.motion, 2);
        Layout { groups, extras, stride, alpha, albedo, normal, position, moment, motion }
    }

    /// Writes the values of a sample beyond the groups, in order, and gives
    /// their number; positions and motion are held to the limit.
    #[inline]
    pub fn write_extras(&self, sample: &PixelSample, limits: &Limits, out: &mut [f64; MAX_EXTRAS]) -> usize {
        let mut put = |at: Option<usize>, values: &[f32]| {
            if let Some(at) = at {
                for (k, v) in values.iter().enumerate() {
                    out[at - self.extras + k] = f64::from(*v);
                }
            }
        };
        put(self.alpha, &[sample.alpha]);
        put(self.albedo, &sample.albedo.to_array());
        put(self.normal, &sample.normal.to_array());
        let limit = limits.position;
        put(self.position, &sample.position.clamp(Vec3::splat(-limit), Vec3::splat(limit)).to_array());
        put(self.motion, &sample.motion.clamp(Vec2::splat(-limit), Vec2::splat(limit)).to_array());
        if let Some(at) = self.moment {
            let squares = (sample.rgb.as_dvec3() * sample.rgb.as_dvec3()).to_array();
            for (k, v) in squares.into_iter().enumerate() {
                out[at - self.extras + k] = v;
            }
        }
        self.stride - self.extras
    }
}
