//! Sets of rays as a path tracer makes them: pure functions of the subject, a
//! count and a seed.

use super::Subject;
use super::contender::epsilon;
use crate::accel::Accel;
use crate::desc::{Error, Result};
use crate::math::{Frame, Ray, Vec2, Vec3};
use crate::sampling::{Sampler, cosine_hemisphere};
use crate::shape::{Hit, SurfacePoint};

/// Which rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RaySet {
    /// Primary rays in the order of tiles of 16 × 16.
    Camera,
    /// Rays that leave the first hits, distributed by the cosine.
    Bounce1,
    /// Rays that leave the third hits.
    Bounce3,
    /// Shadow rays from the first hits.
    Shadow1,
    /// Shadow rays from the third hits.
    Shadow3,
    /// Rays from anywhere in the box, aimed exactly at vertices.
    Vertex,
    /// The rays of [`RaySet::Bounce1`], which are made and not traced: what a
    /// point of a surface and a ray that leaves it cost.
    Spawn,
}

impl RaySet {
    /// All of them.
    pub const ALL: [RaySet; 7] = [
        RaySet::Camera,
        RaySet::Bounce1,
        RaySet::Bounce3,
        RaySet::Shadow1,
        RaySet::Shadow3,
        RaySet::Vertex,
        RaySet::Spawn,
    ];

    /// Its name in options and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            RaySet::Camera => "camera",
            RaySet::Bounce1 => "b1",
            RaySet::Bounce3 => "b3",
            RaySet::Shadow1 => "s1",
            RaySet::Shadow3 => "s3",
            RaySet::Vertex => "vertex",
            RaySet::Spawn => "spawn",
        }
    }

    /// The set of a name.
    pub fn named(name: &str) -> Result<RaySet> {
        RaySet::ALL.into_iter().find(|set| set.name() == name).ok_or_else(|| {
            Error::new(format!("unknown ray set `{name}`")).suggest(name, RaySet::ALL.map(RaySet::name))
        })
    }

    /// Asked whether there is any hit, not for the nearest.
    #[must_use]
    pub fn is_shadow(self) -> bool {
        matches!(self, RaySet::Shadow1 | RaySet::Shadow3)
    }

    /// Scattered and traced: neither from the camera nor aimed at vertices.
    #[must_use]
    pub fn is_incoherent(self) -> bool {
        !matches!(self, RaySet::Camera | RaySet::Vertex | RaySet::Spawn)
    }
}

/// Rays of one set.
#[derive(Clone, Debug, PartialEq)]
pub struct Rays {
    /// Which.
    pub set: RaySet,
    /// In the order in which they are traced. Empty when nothing is hit that
    /// they could leave.
    pub rays: Vec<Ray>,
    /// The same rays a fixed distance off the surfaces that they leave, for
    /// tracers that need it.
    pub pushed: Vec<Ray>,
    /// How they are made, for [`RaySet::Spawn`].
    pub spawns: Vec<Spawn>,
}

/// A ray that is to leave a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spawn {
    /// The ray that has hit.
    pub ray: Ray,
    /// Its hit.
    pub hit: Hit,
    /// Where to go: a unit vector.
    pub dir: Vec3,
}

/// The place of a hit and the normal on the side that was hit.
struct Place {
    ray: Ray,
    hit: Hit,
    surface: SurfacePoint,
    normal: Vec3,
}

impl Place {
    /// A ray that leaves the place, from a fixed distance off it; a shadow ray
    /// ends as far before its light.
    fn pushed(&self, ray: &Ray, epsilon: f32) -> Ray {
        if ray.t_max.is_infinite() {
            return self.surface.spawn_off(ray.dir, epsilon);
        }
        let off = self.surface.spawn_off(ray.dir, epsilon);
        let dir = ray.origin + ray.dir - off.origin;
        Ray { dir, t_max: 1.0 - epsilon / dir.length(), ..off }
    }
}

/// Makes `count` rays of each of the sets, with the hits that `accel` finds;
/// any accelerator gives the same ones.
#[must_use]
pub fn ray_sets(subject: &Subject, accel: &Accel, sets: &[RaySet], count: usize, seed: u64) -> Vec<Rays> {
    let maker = Maker { subject, accel, count, seed };
    let camera = maker.camera();
    let first = maker.places(&camera);
    let second = maker.places(&maker.alone(maker.bounce(&first, 1)));
    let third = maker.places(&maker.alone(maker.bounce(&second, 2)));
    sets.iter().map(|set| maker.rays(*set, &camera, &first, &third)).collect()
}

struct Maker<'a> {
    subject: &'a Subject,
    accel: &'a Accel,
    count: usize,
    seed: u64,
}

const TILE: usize = 16;

impl Maker<'_> {
    fn rays(&self, set: RaySet, camera: &[Ray], first: &[Place], third: &[Place]) -> Rays {
        let departures = match set {
            RaySet::Camera | RaySet::Vertex => {
                let rays = if set == RaySet::Camera { camera.to_vec() } else { self.vertex(6) };
                return Rays { set, pushed: rays.clone(), rays, spawns: Vec::new() };
            }
            RaySet::Bounce1 | RaySet::Spawn => self.bounce(first, 1),
            RaySet::Bounce3 => self.bounce(third, 3),
            RaySet::Shadow1 => self.shadow(first, 4),
            RaySet::Shadow3 => self.shadow(third, 5),
        };
        let epsilon = epsilon(self.subject.geometry());
        let spawn = |(place, ray): &(&Place, Ray)| Spawn { ray: place.ray, hit: place.hit, dir: ray.dir };
        let spawned = if set == RaySet::Spawn { &*departures } else { &[] };
        Rays {
            set,
            spawns: spawned.iter().map(spawn).collect(),
            pushed: departures.iter().map(|(place, ray)| place.pushed(ray, epsilon)).collect(),
            rays: self.alone(departures),
        }
    }

    /// Rays without the places that they leave.
    fn alone(&self, departures: Vec<(&Place, Ray)>) -> Vec<Ray> {
        departures.into_iter().map(|(_, ray)| ray).collect()
    }

    /// Random numbers of ray `i` of one use.
    fn random(&self, i: usize, purpose: i32) -> Sampler {
        Sampler::new(self.seed, (i as i32, purpose), (i >> 31) as u64)
    }

    fn camera(&self) -> Vec<Ray> {
        let aspect = f64::from(self.subject.aspect());
        let width = ((self.count as f64 * aspect).sqrt().round() as usize).max(1);
        let height = self.count.div_ceil(width);
        let mut rays = Vec::with_capacity(width * height);
        for tile in 0..width.div_ceil(TILE) * height.div_ceil(TILE) {
            let (tx, ty) = (tile % width.div_ceil(TILE) * TILE, tile / width.div_ceil(TILE) * TILE);
            for y in ty..(ty + TILE).min(height) {
                for x in tx..(tx + TILE).min(width) {
                    let random = self.random(y * width + x, 0);
                    let at = Vec2::new(x as f32, y as f32) + random.get_2d(0);
                    let at = at / Vec2::new(width as f32, height as f32);
                    rays.push(self.subject.camera_ray(at, random.get_2d(1)));
                }
            }
        }
        rays.truncate(self.count);
        rays
    }

    /// Where rays hit.
    fn places(&self, rays: &[Ray]) -> Vec<Place> {
        let geometry = self.subject.geometry();
        rays.iter()
            .filter_map(|ray| {
                let hit = self.accel.closest(geometry, ray)?;
                let surface = geometry.surface(ray, &hit);
                let normal = if ray.dir.dot(surface.ng) > 0.0 { -surface.ng } else { surface.ng };
                Some(Place { ray: *ray, hit, surface, normal })
            })
            .collect()
    }

    /// Diffuse bounces; every place is used as often as it takes.
    fn bounce<'p>(&self, places: &'p [Place], purpose: i32) -> Vec<(&'p Place, Ray)> {
        let rays = places.iter().cycle().take(self.count).enumerate().map(|(i, place)| {
            let local = cosine_hemisphere(self.random(i, purpose).get_2d(0));
            (place, place.surface.spawn(Frame::from_normal(place.normal).to_world(local)))
        });
        rays.collect()
    }

    fn shadow<'p>(&self, places: &'p [Place], purpose: i32) -> Vec<(&'p Place, Ray)> {
        let rays = places.iter().cycle().take(8 * self.count).enumerate().filter_map(|(i, place)| {
            let random = self.random(i, purpose);
            let u = [random.get_2d(0), random.get_2d(1)];
            let ray = self.subject.shadow_ray(&place.surface, place.normal, random.get_1d(0), u)?;
            Some((place, ray))
        });
        rays.take(self.count).collect()
    }

    fn vertex(&self, purpose: i32) -> Vec<Ray> {
        let geometry = self.subject.geometry();
        let bounds = geometry.bounds();
        let rays = (0..self.count).filter_map(|i| {
            let random = self.random(i, purpose);
            let (a, b) = (random.get_2d(0), random.get_2d(1));
            let origin = bounds.min + bounds.extent() * Vec3::new(a.x, a.y, b.x);
            let pick = f64::from(b.y) * f64::from(geometry.triangle_count());
            let corner = (random.get_1d(0) * 3.0) as usize;
            Some(Ray::new(origin, geometry.triangle(pick as u32)?[corner.min(2)] - origin))
        });
        rays.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::tracing::displaced;

    #[test]
    fn rays_are_a_function_of_the_seed() {
        let subject = displaced(1 << 10).unwrap();
        let accel = Accel::build_named(None, subject.geometry()).unwrap();
        let brute = Accel::build_named(Some("brute"), subject.geometry()).unwrap();
        let make = |accel, seed| ray_sets(&subject, accel, &RaySet::ALL, 500, seed);
        let sets = make(&accel, 1);
        assert_eq!(sets, make(&brute, 1), "any accelerator makes the same rays");
        for (a, b) in sets.iter().zip(make(&accel, 2)) {
            assert_eq!(a.rays.len(), 500, "{}", a.set.name());
            assert!(a.rays.iter().zip(&b.rays).filter(|(a, b)| a == b).count() < 5, "{}", a.set.name());
        }
        // Inside a closed tunnel every bounce hits.
        for set in sets.iter().filter(|s| matches!(s.set, RaySet::Bounce1 | RaySet::Bounce3)) {
            let hits = set.rays.iter().filter(|r| accel.closest(subject.geometry(), r).is_some()).count();
            assert_eq!(hits, 500, "{}", set.set.name());
        }
        assert!(sets.iter().all(|s| RaySet::named(s.set.name()).unwrap() == s.set));
    }
}
