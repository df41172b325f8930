//! A measured material, as Dupuy and Jakob (2018), "An Adaptive
//! Parameterization for Efficient Material Acquisition and Rendering" (ACM TOG
//! 37(6)), tabulate it; `wo` here is their ω_i and `wi` their ω_o.
//!
//! With m the half vector and u(m) its place in the unit square, and ν the map
//! of the square that carries uniform points to the density of visible normals
//! as seen from wo,
//!
//! f·cos θi = s(ν⁻¹(u(m))) · D(m) / (4 σ(wo)),
//!
//! where s is smooth and D/(4σ) left out in files that do not ask for it. To
//! sample, a point is drawn by the luminance of s, carried by ν to a normal, and
//! wo reflected about that; the density is the product of the two, divided by
//! |∂m/∂u| = 2π² u₁ sin θm and |∂wi/∂m| = 4 ⟨wo, m⟩. All tables are linear in
//! wo between the angles that were measured, and constant beyond.
//!
//! Values agree with Mitsuba 3.9.1 (`scalar_rgb`). What differs on purpose:
//! there |∂m/∂u| has a floor of 1e-6, a slice of no luminance makes the density
//! NaN (here it counts as uniform), and anisotropic tables jump where wo.y is
//! exactly 0, the azimuth being taken for the far end of the table.
//!
//! The density is linear in u₁ at the pole of normals, where |∂m/∂u| falls as
//! u₁³: it is unbounded, and integrable, about the mirror direction. What is
//! measured is reciprocal only as far as the material, the device and the
//! interpolation are.

use std::f32::consts::{FRAC_2_PI, FRAC_PI_2, PI};
use std::sync::Arc;

use super::BsdfSample;
use super::fresnel::reflect;
use super::microfacet::unit;
use crate::desc::{MeasuredData, Nodes};
use crate::math::{Rgb, Vec2, Vec3};
use crate::sampling::{Blend, Cell, SlicedSquare};

/// Least |∂wi/∂u|, so that densities stay finite: reached where m is within
/// 1e-9 of the pole, or wo and wi within as much of the horizon.
const LEAST_STRETCH: f32 = 1e-18;
/// Samples along each axis by which the albedo of a slice is known.
const ALBEDO_SIDE: usize = 12;

/// The tables of a measured material, one-sided.
#[derive(Clone, Debug)]
pub struct Measured {
    data: Arc<MeasuredData>,
    vndf: SlicedSquare,
    luminance: SlicedSquare,
    /// How many times the azimuths of the tables cover the circle: 1, 2 or 4.
    parts: u32,
    /// Share of light that is reflected, of each slice.
    albedo: Vec<Rgb>,
}

/// The viewer, turned to the azimuths that were measured.
struct View {
    /// Signs of x and y by which it was turned.
    turn: Vec2,
    wo: Vec3,
    /// Direction of the azimuth that normals are relative to.
    azimuth: Vec2,
    blend: Blend,
    /// Place in the square of `sigma`.
    place: [f32; 2],
}

impl Measured {
    /// The tables of a measurement.
    ///
    /// # Errors
    /// What [`MeasuredData::check`] says.
    pub fn new(data: Arc<MeasuredData>) -> Result<Measured, String> {
        data.check()?;
        let table = |name: &str, nodes: &Nodes| {
            let [columns, rows] = nodes.size.map(|n| n as usize);
            let table = SlicedSquare::new(columns, rows, &nodes.values);
            table.ok_or_else(|| format!("`{name}` is no density"))
        };
        let (vndf, luminance) = (table("vndf", &data.vndf)?, table("luminance", &data.luminance)?);
        let parts = data.parts().unwrap_or(1);
        let mut measured = Measured { data, vndf, luminance, parts, albedo: Vec::new() };
        measured.albedo = measured.albedos();
        Ok(measured)
    }

    /// True when it looks different from different azimuths.
    #[must_use]
    pub fn is_anisotropic(&self) -> bool {
        self.data.phi.len() > 1
    }

    /// Heap memory in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        let nodes = |nodes: &Nodes| 4 * nodes.values.len();
        let data = &self.data;
        let raw = nodes(&data.ndf) + nodes(&data.sigma) + nodes(&data.vndf) + nodes(&data.luminance);
        raw + 12 * (data.rgb.len() + self.albedo.len())
            + self.vndf.memory_bytes()
            + self.luminance.memory_bytes()
    }

    fn is_isotropic(&self) -> bool {
        self.data.phi.len() <= 2
    }

    /// `None` from below.
    fn view(&self, wo: Vec3) -> Option<View> {
        if !(wo.z > 0.0) {
            return None;
        }
        let against = |x: f32| if x.is_sign_negative() { 1.0 } else { -1.0 };
        let turn = match self.parts {
            2 => Vec2::splat(against(wo.y)),
            4 => Vec2::new(against(wo.x), against(wo.y)),
            _ => Vec2::ONE,
        };
        let wo = turned(wo, turn);
        let (theta, phi) = (elevation(wo), wo.y.atan2(wo.x));
        // Components may be too small for their length to have digits.
        let flat = glam::DVec2::new(wo.x.into(), wo.y.into()).normalize_or_zero().as_vec2();
        let azimuth = if self.is_isotropic() && flat != Vec2::ZERO { flat } else { Vec2::X };
        let blend = Blend::new(&self.data.phi, &self.data.theta, [phi, theta]);
        Some(View { turn, wo, azimuth, blend, place: place(theta, phi) })
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        match self.view(wo) {
            Some(view) if wi.z > 0.0 => self.evaluate(&view, turned(wi, view.turn)),
            _ => (Rgb::ZERO, 0.0),
        }
    }

    fn evaluate(&self, view: &View, wi: Vec3) -> (Rgb, f32) {
        let m = unit(view.wo + wi);
        let theta = elevation(m);
        let flat = m.truncate();
        let u_m = place(theta, view.azimuth.perp_dot(flat).atan2(view.azimuth.dot(flat)));
        let (u, visible) = self.vndf.invert(&view.blend, u_m);
        let value = self.smooth(view, u) * self.factor(view, u_m);
        if value == Rgb::ZERO {
            return (Rgb::ZERO, 0.0);
        }
        let pdf = visible * self.luminance.density(&view.blend, u) / stretch(u_m[0], flat, view.wo.dot(m));
        (value, pdf)
    }

    /// The tabulated part of the value at a point of the square.
    fn smooth(&self, view: &View, u: [f32; 2]) -> Rgb {
        let [columns, rows] = self.data.rgb_size.map(|n| n as usize);
        let nodes = Cell::new(columns, rows, u).nodes();
        let mut sum = Rgb::ZERO;
        for (slice, weight) in view.blend.parts() {
            let slice = slice * columns * rows;
            for (node, share) in nodes {
                sum += Rgb::from_array(self.data.rgb[slice + node]) * (weight * share);
            }
        }
        sum
    }

    /// D/(4σ), or 1 when the file does not want it.
    fn factor(&self, view: &View, u_m: [f32; 2]) -> f32 {
        if !self.data.jacobian {
            return 1.0;
        }
        interpolate(&self.data.ndf, u_m) / (4.0 * interpolate(&self.data.sigma, view.place))
    }

    pub(super) fn sample(&self, wo: Vec3, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let view = self.view(wo)?;
        let [u1, u2] = self.vndf.sample(&view.blend, self.luminance.sample(&view.blend, u.to_array()));
        let (sin, cos) = (FRAC_PI_2 * u1 * u1).sin_cos();
        let (y, x) = (PI * (2.0 * u2 - 1.0)).sin_cos();
        let flat = view.azimuth.rotate(Vec2::new(x, y)) * sin;
        let wi = reflect(view.wo, flat.extend(cos));
        if !(wi.z > 0.0) {
            return None;
        }
        // Of the direction, which is rounded, not of the point it came from.
        let (value, pdf) = self.evaluate(&view, wi);
        BsdfSample::smooth(turned(wi, view.turn), value / pdf, pdf)
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        let Some(view) = self.view(wo) else { return Rgb::ZERO };
        view.blend.parts().map(|(slice, weight)| self.albedo[slice] * weight).sum()
    }

    /// Of each slice, from a grid of samples.
    fn albedos(&self) -> Vec<Rgb> {
        const SAMPLES: f32 = (ALBEDO_SIDE * ALBEDO_SIDE) as f32;
        let slice = |phi: f32, theta: f32| -> Rgb {
            let ((y, x), (sin, cos)) = (phi.sin_cos(), theta.sin_cos());
            // The horizon itself sees nothing.
            let wo = Vec3::new(sin * x, sin * y, cos.max(1e-3));
            let midpoint = |i: usize| (i as f32 + 0.5) / ALBEDO_SIDE as f32;
            let points = (0..ALBEDO_SIDE * ALBEDO_SIDE)
                .map(|i| Vec2::new(midpoint(i % ALBEDO_SIDE), midpoint(i / ALBEDO_SIDE)));
            let weights = points.filter_map(|u| self.sample(wo, 0.0, u)).map(|s| s.weight);
            weights.filter(|w| w.is_finite()).sum::<Rgb>() / SAMPLES
        };
        let phis = self.data.phi.iter();
        phis.flat_map(|phi| self.data.theta.iter().map(|theta| slice(*phi, *theta))).collect()
    }
}

fn turned(w: Vec3, turn: Vec2) -> Vec3 {
    Vec3::new(w.x * turn.x, w.y * turn.y, w.z)
}

/// Angle to z in radians; all digits at both ends.
fn elevation(w: Vec3) -> f32 {
    w.truncate().length().atan2(w.z)
}

/// The point of the square that stands for a direction.
fn place(theta: f32, phi: f32) -> [f32; 2] {
    [(theta * FRAC_2_PI).sqrt(), phi / (2.0 * PI) + 0.5]
}

/// |∂wi/∂u| of the direction reflected about the normal of `u1`.
fn stretch(u1: f32, flat: Vec2, cos: f32) -> f32 {
    (8.0 * PI * PI * u1 * flat.length() * cos).max(LEAST_STRETCH)
}

fn interpolate(table: &Nodes, point: [f32; 2]) -> f32 {
    let [columns, rows] = table.size.map(|n| n as usize);
    Cell::new(columns, rows, point).nodes().iter().map(|(node, weight)| table.values[*node] * weight).sum()
}
