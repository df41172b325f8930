//! Sun and sky as a surrounding: the plugin `sunsky` of Mitsuba 3.9.
//!
//! What shines is evaluated from the model itself; a table of the sky, bilinear
//! between its texels, only decides where samples go. The sun is sampled
//! uniformly in its cone. A sample comes from one of the two, its density is
//! that of both together, and both sides look at the rounded direction.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DMat3, Mat3};

use super::envmap_table::{EnvTable, Weights};
use super::sky_model::{Dome, SolarDisc, cone};
use super::{LightSample, SUN_APERTURE_DEG, Target, grey};
use crate::math::{DVec3, Frame, Rgb, Vec2, Vec3, angle_between};
use crate::sampling::uniform_cone;

/// Light of the sun and of a clear sky, by Hošek and Wilkie.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `turbidity` | 3 | haze, 1 (arctic) to 10 |
/// | `albedo` | 0.3 | colour of the ground, which lights the sky |
/// | `sun_direction` | | towards the sun, in the world; instead of place and time |
/// | `latitude`, `longitude`, `timezone` | 35.6894, 139.6917, 9 | place (Tokyo), degrees and hours |
/// | `year`, `month`, `day`, `hour`, `minute`, `second` | 2010, 7, 10, 15, 0, 0 | local time |
/// | `sun_scale`, `sky_scale` | 1 | factors, ≥ 0 |
/// | `sun_aperture` | 0.5358 | angle across the sun's disc in degrees; its light stays the same |
/// | `complex_sun` | false | the disc darkens towards its limb |
/// | `to_world` | identity | rotation of a frame with z up; x is the south, y the west of a time |
///
/// Below the horizon it is black. A sun below the horizon is an error: the
/// model has no night. With Mitsuba 3.9.1 the sky and the sun of `complex_sun`
/// agree to rounding. Mitsuba's plain sun is tabulated every 3 degrees and
/// 0.3 % brighter than its complex one; ours is the mean of that disc.
#[derive(Clone, Debug)]
pub struct SunSky {
    /// `sampling_weight`.
    pub weight: f32,
    to_local: Mat3,
    to_world: DMat3,
    /// Towards the sun in the frame of the sky, unit.
    sun: Vec3,
    dome: Option<Dome>,
    disc: Option<Disc>,
    table: Option<SkyTable>,
    /// Probability of sampling the sky and not the sun.
    sky_share: f32,
    /// ∫ L dω, mean of channels.
    radiance_integral: f64,
}

/// What the caller decides.
#[derive(Clone, Copy, Debug)]
pub(super) struct SkyOptions {
    pub turbidity: f64,
    pub albedo: Rgb,
    pub sun_scale: f64,
    pub sky_scale: f64,
    /// Across the disc, radians, in (0, π).
    pub aperture: f64,
    pub complex_sun: bool,
    /// Unit, in the frame of the sky, z ≥ 0.
    pub sun: DVec3,
    /// Orthonormal.
    pub to_world: DMat3,
    pub weight: f32,
}

/// The sun's disc.
#[derive(Clone, Debug)]
struct Disc {
    /// Of the same radiance everywhere, or else limb and elevation count.
    uniform: Option<Rgb>,
    solar: Option<SolarDisc>,
    /// The disc's light on a smaller or larger one.
    dilution: f64,
    /// ∫ L dω over what of the disc has not set, mean of channels.
    integral: f64,
    one_minus_cos: f32,
    /// 1 / sin² of half the aperture.
    inverse_sin2: f64,
    pdf: f32,
    frame: Frame,
}

/// The sky on a grid, for sampling: columns over the angle from the sun's
/// azimuth, rows from the zenith to the horizon.
#[derive(Clone, Debug)]
struct SkyTable {
    grid: Grid,
    table: EnvTable,
    /// Azimuth of the sun.
    turn: f64,
}

#[derive(Clone, Debug)]
struct Grid {
    weights: Vec<f32>,
}

const COLUMNS: u32 = 192;
const ROWS: u32 = 64;
/// Least weight of a direction over the mean, so that none is left out.
const FLOOR: f64 = 1e-2;
/// Neither is sampled less than this, where there is both: which of them the
/// receiver sees is not known here.
const LEAST_SHARE: f64 = 0.25;

impl Weights for Grid {
    fn size(&self) -> [u32; 2] {
        [COLUMNS, ROWS]
    }

    fn weight(&self, x: u32, y: u32) -> f64 {
        f64::from(self.weights[(y * COLUMNS + x) as usize])
    }

    fn polar_range(&self) -> f64 {
        FRAC_PI_2
    }
}

impl SkyTable {
    fn new(dome: &Dome, sun: DVec3) -> Option<SkyTable> {
        let turn = sun.y.atan2(sun.x);
        // The sun at azimuth 0.
        let sun = DVec3::new(sun.x.hypot(sun.y), 0.0, sun.z).as_vec3();
        let mut weights = Vec::with_capacity((COLUMNS * ROWS) as usize);
        for row in 0..ROWS {
            let (sin, cos) = (FRAC_PI_2 * f64::from(row) / f64::from(ROWS - 1)).sin_cos();
            for column in 0..COLUMNS {
                let (s, c) = (TAU * (f64::from(column) + 0.5) / f64::from(COLUMNS)).sin_cos();
                let d = DVec3::new(c * sin, s * sin, cos.max(0.0)).as_vec3();
                weights.push(grey(dome.radiance(d.z, angle_between(d, sun))) as f32);
            }
        }
        let mean = weights.iter().map(|w| f64::from(*w)).sum::<f64>() / weights.len() as f64;
        weights.iter_mut().for_each(|w| *w = w.max((FLOOR * mean) as f32));
        let grid = Grid { weights };
        let table = EnvTable::new(&grid)?;
        Some(SkyTable { grid, table, turn })
    }

    /// Density of a direction in the frame of the sky, over the horizon.
    fn pdf(&self, d: Vec3) -> f32 {
        let d = d.as_dvec3();
        let x = (d.y.atan2(d.x) - self.turn).rem_euclid(TAU) / TAU * f64::from(COLUMNS) - 0.5;
        let y = d.x.hypot(d.y).atan2(d.z) / FRAC_PI_2 * f64::from(ROWS - 1);
        let (left, above) = (x.floor(), (y as u32).min(ROWS - 2));
        let (wx, wy) = (x - left, y - f64::from(above));
        let left = (left as i32).rem_euclid(COLUMNS as i32) as u32;
        let right = (left + 1) % COLUMNS;
        let row = |y| self.grid.weight(left, y) * (1.0 - wx) + self.grid.weight(right, y) * wx;
        let weight = row(above) * (1.0 - wy) + row(above + 1) * wy;
        (weight / self.table.integral()) as f32
    }

    fn sample(&self, u: Vec2) -> DVec3 {
        let angles = self.table.sample(&self.grid, u);
        let ((sp, cp), (st, ct)) = ((angles.phi + self.turn).sin_cos(), angles.theta.sin_cos());
        DVec3::new(cp * st, sp * st, ct)
    }
}

/// ∫ L dω of the sky, mean of channels, by the midpoint rule.
fn integrate(dome: &Dome, sun: DVec3) -> f64 {
    let sun = DVec3::new(sun.x.hypot(sun.y), 0.0, sun.z).as_vec3();
    let (rows, columns) = (2 * ROWS, COLUMNS);
    let mut sum = 0.0;
    for row in 0..rows {
        let (sin, cos) = (FRAC_PI_2 * (f64::from(row) + 0.5) / f64::from(rows)).sin_cos();
        for column in 0..columns {
            let (s, c) = (TAU * (f64::from(column) + 0.5) / f64::from(columns)).sin_cos();
            let d = DVec3::new(c * sin, s * sin, cos).as_vec3();
            sum += sin * grey(dome.radiance(d.z, angle_between(d, sun)));
        }
    }
    sum * (FRAC_PI_2 / f64::from(rows)) * (TAU / f64::from(columns))
}

impl Disc {
    fn new(options: &SkyOptions) -> Disc {
        let nominal = 0.5 * SUN_APERTURE_DEG.to_radians();
        let half = 0.5 * options.aperture;
        let dilution = cone(nominal) / cone(half);
        let solar = SolarDisc::new(options.turbidity, options.sun_scale);
        let elevation = options.sun.z.clamp(0.0, 1.0).asin();
        let (mean, visible) = solar.mean(elevation, nominal);
        let uniform = (!options.complex_sun).then(|| (mean * dilution).as_vec3());
        let one_minus_cos = 2.0 * (0.5 * half).sin().powi(2);
        Disc {
            solar: options.complex_sun.then_some(solar),
            uniform,
            dilution,
            integral: mean.element_sum() / 3.0 * cone(nominal) * visible,
            one_minus_cos: one_minus_cos as f32,
            inverse_sin2: half.sin().powi(-2),
            pdf: (1.0 / cone(half)) as f32,
            frame: Frame::from_normal(options.sun.as_vec3()),
        }
    }

    /// True for a direction in the disc. By the chord: 1 − cos has no digits
    /// left at angles as small as the sun's.
    fn holds(&self, d: Vec3) -> bool {
        (d - self.frame.n).length_squared() <= 2.0 * self.one_minus_cos
    }

    /// Radiance from a direction in the disc and over the horizon.
    fn radiance(&self, d: Vec3) -> Rgb {
        if let Some(uniform) = self.uniform {
            return uniform;
        }
        let Some(solar) = &self.solar else { return Rgb::ZERO };
        let d = d.as_dvec3().normalize();
        let sin2 = d.cross(self.frame.n.as_dvec3()).length_squared();
        let cosine = (1.0 - sin2 * self.inverse_sin2).max(0.0).sqrt();
        (solar.radiance(d.z.clamp(0.0, 1.0).asin(), cosine) * self.dilution).as_vec3()
    }
}

impl SunSky {
    pub(super) fn new(options: &SkyOptions) -> SunSky {
        let sun = options.sun.normalize();
        let elevation = sun.z.clamp(0.0, 1.0).asin();
        let dome = (options.sky_scale > 0.0)
            .then(|| Dome::new(options.turbidity, options.albedo, elevation, options.sky_scale));
        let table = dome.as_ref().and_then(|dome| SkyTable::new(dome, sun));
        let disc = (options.sun_scale > 0.0).then(|| Disc::new(options));
        let sky_integral = dome.as_ref().map_or(0.0, |dome| integrate(dome, sun));
        let sun_integral = disc.as_ref().map_or(0.0, |disc| disc.integral);
        let total = sky_integral + sun_integral;
        let sky_share = match (&table, &disc) {
            (Some(_), Some(_)) => (sky_integral / total).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE) as f32,
            (Some(_), None) => 1.0,
            _ => 0.0,
        };
        SunSky {
            weight: options.weight,
            to_local: options.to_world.transpose().as_mat3(),
            to_world: options.to_world,
            sun: sun.as_vec3(),
            dome,
            disc,
            table,
            sky_share,
            radiance_integral: total,
        }
    }

    /// Radiance from a direction in the frame of the sky.
    fn local_radiance(&self, d: Vec3) -> Rgb {
        if !(d.z >= 0.0) {
            return Rgb::ZERO;
        }
        let sky = self.dome.as_ref().map(|dome| dome.radiance(d.z, angle_between(d, self.sun)));
        let sun = self.disc.as_ref().filter(|disc| disc.holds(d)).map(|disc| disc.radiance(d));
        sky.unwrap_or_default() + sun.unwrap_or_default()
    }

    fn local_pdf(&self, d: Vec3) -> f32 {
        if !(d.z >= 0.0) {
            return 0.0;
        }
        let sky = self.table.as_ref().map_or(0.0, |table| self.sky_share * table.pdf(d));
        let sun = self.disc.as_ref().filter(|disc| disc.holds(d)).map_or(0.0, |disc| disc.pdf);
        sky + (1.0 - self.sky_share) * sun
    }

    pub(super) fn radiance(&self, wi: Vec3) -> Rgb {
        self.local_radiance(self.to_local * wi)
    }

    pub(super) fn pdf(&self, wi: Vec3) -> f32 {
        self.local_pdf(self.to_local * wi)
    }

    pub(super) fn sample(&self, u: Vec2) -> Option<LightSample> {
        let d = match (&self.table, &self.disc) {
            (Some(table), _) if u.x < self.sky_share => {
                table.sample(Vec2::new((u.x / self.sky_share).min(crate::math::ONE_MINUS_EPSILON), u.y))
            }
            (_, Some(disc)) => {
                let x = ((u.x - self.sky_share) / (1.0 - self.sky_share)).min(crate::math::ONE_MINUS_EPSILON);
                disc.frame.to_world(uniform_cone(Vec2::new(x, u.y), disc.one_minus_cos)).as_dvec3()
            }
            _ => return None,
        };
        let wi = (self.to_world * d).normalize().as_vec3();
        Some(LightSample {
            wi,
            radiance: self.radiance(wi),
            pdf: self.pdf(wi),
            delta: false,
            target: Target::Infinite,
        })
    }

    pub(super) fn radiance_integral(&self) -> f64 {
        self.radiance_integral
    }

    pub(super) fn memory_bytes(&self) -> usize {
        let table = self.table.as_ref().map_or(0, |t| t.table.memory_bytes() + 4 * t.grid.weights.len());
        let solar = self.disc.as_ref().and_then(|d| d.solar.as_ref()).map_or(0, SolarDisc::memory_bytes);
        table + solar
    }
}

#[cfg(test)]
#[allow(clippy::excessive_precision, reason = "reference numbers stand as they were printed")]
mod tests {
    use super::*;

    fn options(turbidity: f64, albedo: f64, sun: [f64; 3]) -> SkyOptions {
        SkyOptions {
            turbidity,
            albedo: Rgb::splat(albedo as f32),
            sun_scale: 1.0,
            sky_scale: 1.0,
            aperture: SUN_APERTURE_DEG.to_radians(),
            complex_sun: true,
            sun: DVec3::from(sun).normalize(),
            to_world: DMat3::IDENTITY,
            weight: 1.0,
        }
    }

    type Sight = (f64, f64, [f64; 3], [f64; 3], [f64; 3]);

    /// Mitsuba 3.9.1, `scalar_rgb`: turbidity, albedo, sun, direction, and what
    /// `mi.load_dict({'type': 'sunsky', 'complex_sun': True, …})` gives there.
    const MITSUBA: [Sight; 7] = [
        (
            3.0,
            0.3,
            [0.766044443, 0.0, 0.64278761],
            [0.0, 0.0, 1.0],
            [0.021171961, 0.0380300172, 0.0770879388],
        ),
        (
            1.0,
            0.0,
            [-0.936116807, -0.340718653, 0.0871557427],
            [0.979404214, 0.195880843, 0.0489702107],
            [0.113394871, 0.103807569, 0.052628614],
        ),
        (
            10.0,
            1.0,
            [0.0435778714, 0.0754790873, 0.996194698],
            [-0.424264069, 0.70710679, 0.565685425],
            [0.170707077, 0.192176864, 0.234965876],
        ),
        (
            4.5,
            0.6,
            [0.813797681, -0.46984631, 0.342020143],
            [0.780720058, -0.390360029, 0.487950036],
            [0.352227122, 0.337164402, 0.27418074],
        ),
        (
            3.0,
            0.3,
            [0.766044443, 0.0, 0.64278761],
            [0.766044443, 0.0, 0.64278761],
            [25443.416, 21460.8047, 16323.2002],
        ),
        (
            1.7,
            0.0,
            [-0.171958246, 0.975223672, 0.139173101],
            [-0.169805924, 0.975710562, 0.138401042],
            [16725.6719, 9617.41016, 2779.34521],
        ),
        (
            8.0,
            0.3,
            [0.492403877, 0.0868240888, 0.866025404],
            [0.49220707, 0.0826528044, 0.866545275],
            [15613.6064, 12359.6016, 9030.89648],
        ),
    ];

    #[test]
    fn agrees_with_mitsuba_391() {
        for (turbidity, albedo, sun, d, expected) in MITSUBA {
            let sky = SunSky::new(&options(turbidity, albedo, sun));
            let found = sky.radiance(DVec3::from(d).as_vec3()).as_dvec3();
            let off = ((found - DVec3::from(expected)) / DVec3::from(expected)).abs().max_element();
            // Next to the limb Mitsuba's f32 has three digits.
            let limit = if expected[0] > 100.0 { 5e-4 } else { 1e-5 };
            assert!(off < limit, "turbidity {turbidity}: {found} not {expected:?}");
        }
    }

    /// Rings around the sun: their directions and solid angles.
    fn rings(sky: &SunSky, half: f64) -> impl Iterator<Item = (Vec3, f64)> + use<> {
        const RINGS: u32 = 200;
        const TURNS: u32 = 64;
        let frame = Frame::from_normal(sky.sun);
        (0..RINGS * TURNS).map(move |i| {
            let u = (f64::from(i / TURNS) + 0.5) / f64::from(RINGS);
            let gamma = 2.0 * ((0.5 * half).sin() * u.sqrt()).asin();
            let (s, c) = (TAU * (f64::from(i % TURNS) + 0.5) / f64::from(TURNS)).sin_cos();
            let d = DVec3::new(gamma.sin() * c, gamma.sin() * s, gamma.cos()).as_vec3();
            (frame.to_world(d), cone(half) / f64::from(RINGS * TURNS))
        })
    }

    /// The sun's light is the same for every size of its disc, plain or not,
    /// and what samples of it bring is that light.
    #[test]
    fn the_suns_light_does_not_depend_on_its_size() {
        let mut first: Option<DVec3> = None;
        for (degrees, complex_sun) in
            [(0.5358, false), (0.5358, true), (0.01, false), (0.05, true), (5.0, false), (10.0, true)]
        {
            let mut options = options(3.0, 0.3, [0.5, 0.2, 0.8]);
            (options.sky_scale, options.complex_sun) = (0.0, complex_sun);
            options.aperture = f64::to_radians(degrees);
            let sky = SunSky::new(&options);
            let half = 0.5 * options.aperture;
            let (mut light, mut density) = (DVec3::ZERO, 0.0);
            for (d, solid_angle) in rings(&sky, half) {
                light += sky.radiance(d).as_dvec3() * solid_angle;
                density += f64::from(sky.pdf(d)) * solid_angle;
            }
            assert!((density - 1.0).abs() < 1e-4, "{degrees}: density {density}");
            let expected = *first.get_or_insert(light);
            let off = (light / expected - DVec3::ONE).abs().max_element();
            // A disc of 10 degrees reaches into other elevations.
            assert!(off < if degrees > 1.0 && complex_sun { 2e-2 } else { 2e-4 }, "{degrees}: {off}");
            let grey = light.element_sum() / 3.0;
            assert!((sky.radiance_integral() / grey - 1.0).abs() < if degrees > 1.0 { 2e-2 } else { 2e-4 });

            let n = 4096;
            let mut mean = DVec3::ZERO;
            for i in 0..n {
                let u = Vec2::new((i as f32 + 0.5) / n as f32, (i as f32 * 0.618_034).fract());
                let sample = sky.sample(u).expect("the sun is over the horizon");
                assert_eq!(sample.pdf, sky.pdf(sample.wi));
                mean += sample.radiance.as_dvec3() / f64::from(sample.pdf) / f64::from(n);
            }
            let off = (mean / light - DVec3::ONE).abs().max_element();
            assert!(off < 2e-3, "{degrees}: samples bring {mean}, not {light}");
        }
    }

    /// What the table says of the sky is near enough: radiance over density
    /// hardly varies.
    #[test]
    fn the_sky_is_sampled_in_proportion() {
        for (turbidity, sun) in [(1.0, [0.9, 0.1, 0.1]), (3.0, [0.5, 0.2, 0.8]), (10.0, [-0.3, 0.9, 0.3])] {
            let mut options = options(turbidity, 0.3, sun);
            options.sun_scale = 0.0;
            let sky = SunSky::new(&options);
            let (mut sum, mut squares, n) = (0.0, 0.0, 20_000);
            for i in 0..n {
                let u = Vec2::new((i as f32 + 0.5) / n as f32, (i as f32 * 0.618_034).fract());
                let sample = sky.sample(u).expect("all of it is over the horizon");
                let weight = grey(sample.radiance) / f64::from(sample.pdf);
                sum += weight;
                squares += weight * weight;
            }
            let (mean, n) = (sum / f64::from(n), f64::from(n));
            let spread = (squares / n / mean / mean - 1.0).max(0.0).sqrt();
            assert!(spread < 0.03, "turbidity {turbidity}: {spread}");
            assert!((sky.radiance_integral() / mean - 1.0).abs() < 1e-3, "turbidity {turbidity}");
        }
    }

    /// Half of the disc of a sun on the horizon is there, in its light and in
    /// its integral.
    #[test]
    fn a_setting_sun_is_cut_off() {
        let mut options = options(3.0, 0.3, [1.0, 0.0, 0.0]);
        (options.sky_scale, options.complex_sun) = (0.0, false);
        let sky = SunSky::new(&options);
        assert!(sky.radiance(Vec3::new(1.0, 0.0, 1e-3).normalize()).x > 0.0);
        assert_eq!(sky.radiance(Vec3::new(1.0, 0.0, -1e-3).normalize()), Rgb::ZERO);
        let radiance = grey(sky.radiance(Vec3::new(1.0, 0.0, 1e-3).normalize()));
        let half = 0.5 * cone(0.5 * SUN_APERTURE_DEG.to_radians()) * radiance;
        assert!((sky.radiance_integral() / half - 1.0).abs() < 1e-3);
    }
}
