//! A measured material as decoded from a file.

use super::Fnv;

/// What was measured of a material, after Dupuy and Jakob (2018), "An Adaptive
/// Parameterization for Efficient Material Acquisition and Rendering". ω_i
/// points to the viewer here, as the path goes, and ω_o to the light.
///
/// A point (u₁, u₂) of the unit square stands for the direction of elevation
/// θ = π/2 u₁² and azimuth φ = π (2 u₂ − 1). A *slice* is one pair of `phi` and
/// `theta`, that of `phi[i]` and `theta[j]` being number i · len(theta) + j.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeasuredData {
    /// Elevations of ω_i in radians, rising, 0 to π/2.
    pub theta: Vec<f32>,
    /// Azimuths of ω_i in radians, rising. One or two: the material is
    /// isotropic, and azimuths of normals are relative to that of ω_i.
    pub phi: Vec<f32>,
    /// D, the density of the normals of facets.
    pub ndf: Nodes,
    /// σ(ω_i), the area of the facets as seen from there.
    pub sigma: Nodes,
    /// Density of the visible normals over the square, each slice up to a factor.
    pub vndf: Nodes,
    /// Luminance of `rgb`, each slice up to a factor; what is sampled.
    pub luminance: Nodes,
    /// Columns and rows of `rgb`.
    pub rgb_size: [u32; 2],
    /// Linear sRGB of f·cos θ_o, divided by D/(4σ) if `jacobian`: slice by slice,
    /// row by row, over the square that `vndf` carries to the normals.
    pub rgb: Vec<[f32; 3]>,
    /// The values of `rgb` are to be multiplied by D(m)/(4σ(ω_i)).
    pub jacobian: bool,
}

/// Values at the nodes of a grid over the unit square, edges included.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nodes {
    /// Nodes along u₁ and u₂.
    pub size: [u32; 2],
    /// Slice by slice, row by row along u₁.
    pub values: Vec<f32>,
}

/// Most slices: each takes time of its own when tables are made.
const SLICES: usize = 16_384;
/// Most nodes along a side of a grid.
const SIDE: u32 = 8192;
/// Largest value that a bsdf may come to.
const LARGEST: f64 = 1e30;

impl MeasuredData {
    /// How many slices there are.
    #[must_use]
    pub fn slices(&self) -> usize {
        self.phi.len() * self.theta.len()
    }

    /// How many times the range of `phi`, from -π on if not all of it, covers all
    /// azimuths, to the nearest whole number: 1, 2 (the other half is the same
    /// turned by half a turn) or 4 (mirrored at both axes). `None` for ranges that
    /// are none of these.
    #[must_use]
    pub fn parts(&self) -> Option<u32> {
        use std::f32::consts::{PI, TAU};
        let (Some(first), Some(last)) = (self.phi.first(), self.phi.last()) else { return None };
        if self.phi.len() <= 2 {
            return Some(1);
        }
        let parts = (TAU / (last - first)).round();
        let known = parts == 1.0 || ((parts == 2.0 || parts == 4.0) && (first + PI).abs() < 0.1);
        known.then_some(parts as u32)
    }

    /// Fails, with the name of the field first, when sizes do not fit together
    /// or values mean nothing: what holds after it is all that evaluation
    /// relies on to stay finite.
    pub fn check(&self) -> Result<(), String> {
        rising("theta_i", &self.theta, [0.0, 1.571])?;
        rising("phi_i", &self.phi, [-6.284, 6.284])?;
        if self.slices() > SLICES {
            let (theta, phi) = (self.theta.len(), self.phi.len());
            return Err(format!("`theta_i` and `phi_i` make {theta} × {phi} slices, more than {SLICES}"));
        }
        if self.parts().is_none() {
            let (first, last) = (self.phi[0], self.phi[self.phi.len() - 1]);
            return Err(format!(
                "`phi_i` runs from {first} to {last}, expected all azimuths, or -π to 0, or -π to -π/2"
            ));
        }
        self.ndf.check("ndf", 1)?;
        self.sigma.check("sigma", 1)?;
        self.vndf.check("vndf", self.slices())?;
        self.luminance.check("luminance", self.slices())?;
        let [width, height] = self.rgb_size;
        check_size("rgb", self.rgb_size, self.rgb.len(), self.slices())?;
        if let Some(index) = self.rgb.iter().position(|v| !v.iter().all(|v| *v >= 0.0 && v.is_finite())) {
            let value = self.rgb[index];
            return Err(format!("`rgb` of {width} × {height}: node {index} is {value:?}"));
        }
        if let Some(index) = self.sigma.values.iter().position(|v| *v <= 0.0) {
            return Err(format!("`sigma`: value {index} is 0, expected an area"));
        }
        let largest = |values: &mut dyn Iterator<Item = f32>| f64::from(values.fold(0.0, f32::max));
        let rgb = largest(&mut self.rgb.iter().flatten().copied());
        let ndf = largest(&mut self.ndf.values.iter().copied());
        let sigma = f64::from(self.sigma.values.iter().copied().fold(f32::MAX, f32::min));
        let factor = if self.jacobian { ndf / (4.0 * sigma) } else { 1.0 };
        if !(rgb < LARGEST && factor < LARGEST && rgb * factor < LARGEST) {
            return Err(format!(
                "`rgb` of up to {rgb:.1e} times `ndf`/(4 `sigma`) of up to {factor:.1e} is too much"
            ));
        }
        Ok(())
    }

    pub(super) fn hash(&self, hash: &mut Fnv) {
        let mut floats = |values: &[f32]| values.iter().for_each(|x| hash.bytes(&x.to_bits().to_le_bytes()));
        [&self.theta, &self.phi].into_iter().for_each(|v| floats(v));
        self.rgb.iter().for_each(|v| floats(v));
        let grids = [&self.ndf, &self.sigma, &self.vndf, &self.luminance];
        grids.into_iter().for_each(|grid| floats(&grid.values));
        let sizes = grids.map(|grid| grid.size).into_iter().chain([self.rgb_size]);
        sizes.flatten().for_each(|n| hash.bytes(&n.to_le_bytes()));
        hash.bytes(&[u8::from(self.jacobian)]);
    }
}

impl Nodes {
    fn check(&self, name: &str, slices: usize) -> Result<(), String> {
        check_size(name, self.size, self.values.len(), slices)?;
        match self.values.iter().position(|v| !(*v >= 0.0 && v.is_finite())) {
            Some(index) => Err(format!("`{name}`: value {index} is {}", self.values[index])),
            None => Ok(()),
        }
    }
}

fn check_size(name: &str, [width, height]: [u32; 2], count: usize, slices: usize) -> Result<(), String> {
    let sides = 2..=SIDE;
    if !sides.contains(&width) || !sides.contains(&height) {
        return Err(format!("`{name}` has {width} × {height} nodes, expected 2 to {SIDE} each way"));
    }
    if count as u64 != u64::from(width) * u64::from(height) * slices as u64 {
        return Err(format!("`{name}` has {count} values, expected {slices} times {width} × {height}"));
    }
    Ok(())
}

/// Checks a list of angles.
fn rising(name: &str, values: &[f32], [low, high]: [f32; 2]) -> Result<(), String> {
    if values.is_empty() {
        return Err(format!("`{name}` is empty"));
    }
    for (index, value) in values.iter().enumerate() {
        if !(*value >= low && *value <= high) {
            return Err(format!("`{name}`: value {index} is {value}, expected an angle in radians"));
        }
        if index > 0 && !(*value > values[index - 1]) {
            return Err(format!("`{name}`: value {index} does not rise"));
        }
    }
    Ok(())
}
