//! The opening of a lens: a disk, or a polygon of blades, perhaps squeezed.

use glam::DVec2;

use crate::math::Vec2;
use crate::sampling::concentric_disk;

/// The shape of a lens's opening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Aperture {
    /// Radius of the circle around it.
    pub radius: f64,
    /// Corners of the regular polygon; 0 for a disk.
    pub blades: u32,
    /// Angle of the first corner from +x in radians, towards +y.
    pub rotation: f64,
    /// Height over width: above 1 for the upright ovals of anamorphic lenses.
    pub ratio: f64,
}

impl Aperture {
    pub fn disk(radius: f64) -> Aperture {
        Aperture { radius, blades: 0, rotation: 0.0, ratio: 1.0 }
    }

    /// The point of the opening, uniform in area, that `u` in \[0, 1)² picks.
    pub fn sample(&self, u: Vec2) -> DVec2 {
        let unit = if self.blades == 0 { concentric_disk(u).as_dvec2() } else { self.polygon(u.as_dvec2()) };
        DVec2::new(unit.x / self.ratio, unit.y) * self.radius
    }

    /// One of the polygon's triangles about the centre, then a point of it:
    /// √u from the centre, evenly along the side there.
    fn polygon(&self, u: DVec2) -> DVec2 {
        let sides = f64::from(self.blades);
        let side = (u.x * sides).floor().min(sides - 1.0);
        let along = u.x * sides - side;
        let corner = |k: f64| DVec2::from_angle(self.rotation + std::f64::consts::TAU * k / sides);
        corner(side).lerp(corner(side + 1.0), along) * u.y.sqrt()
    }
}
