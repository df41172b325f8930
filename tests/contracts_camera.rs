//! Contracts of all cameras, and rays against Mitsuba 3.9.1.
//!
//! The reference rays were printed by the Python module of Mitsuba 3.9.1,
//! variant `scalar_rgb`: `mi.load_dict({"type": "perspective", …})`, then
//! `sensor.sample_ray(0, 0, [x / width, y / height], lens)`.

#![allow(clippy::excessive_precision, reason = "reference numbers stand as they were printed")]

#[path = "common/describe.rs"]
mod describe;

use describe::{Describe, float, look_at, string, transform};
use etendue::camera::{Camera, FilmSize, camera_position};
use etendue::desc::{Category, Error, Value};
use etendue::math::{DMat4, DVec3, Ray, Vec2, Vec3};
use etendue::sampling::concentric_disk;
use rand::{RngExt, SeedableRng};

const LANDSCAPE: FilmSize = FilmSize { width: 60, height: 40 };
const PORTRAIT: FilmSize = FilmSize { width: 30, height: 40 };

fn read(plugin: &str, params: Params, film: FilmSize, recentre: DVec3) -> Result<Camera, Error> {
    let mut d = Describe::new();
    let id = d.object(Category::Sensor, plugin, params);
    Camera::from_desc(&d.scene, id, film, recentre)
}

fn view() -> DMat4 {
    look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, -1.0, 2.0), DVec3::new(0.0, 1.0, 0.2))
}

type Params = Vec<(&'static str, Value)>;

/// Film position, origin, direction, t_max.
type Row = ([f32; 2], [f32; 3], [f32; 3], f32);

fn near(a: Vec3, b: [f32; 3], tolerance: f32) -> bool {
    (a - Vec3::from(b)).abs().max_element() <= tolerance
}

fn check(name: &str, camera: &Camera, lens: [f32; 2], rows: &[Row]) {
    for (film, origin, dir, t_max) in rows {
        let ray = camera.ray(Vec2::from(*film), Vec2::from(lens), 0.25);
        assert!(near(ray.origin, *origin, 2e-6), "{name} {film:?}: origin {} not {origin:?}", ray.origin);
        assert!(near(ray.dir, *dir, 5e-7), "{name} {film:?}: direction {} not {dir:?}", ray.dir);
        assert!((ray.t_max / t_max - 1.0).abs() < 1e-6, "{name} {film:?}: t_max {} not {t_max}", ray.t_max);
        assert_eq!((ray.time, ray.skip), (0.25, Ray::NO_SKIP));
    }
}

#[test]
fn perspective_rays_are_mitsubas() {
    let fov = |axis| -> Params { vec![("fov", float(50.0)), ("fov_axis", string(axis))] };
    let turned = vec![("to_world", transform(view())), ("fov", float(45.0))];
    let shifted = vec![
        ("fov", float(45.0)),
        ("principal_point_offset_x", float(0.1)),
        ("principal_point_offset_y", float(-0.2)),
    ];
    let clipped = vec![("fov", float(45.0)), ("near_clip", float(0.5)), ("far_clip", float(7.0))];
    let (long, wide) = ([0.0069946144, 0.0046630763, 0.01], [0.0046630763, 0.0031087175, 0.01]);
    let table: Vec<(Params, FilmSize, Vec<Row>)> = vec![
        (
            turned,
            LANDSCAPE,
            vec![
                (
                    [0.0, 0.0],
                    [1.0083166, 1.9958531, 2.9938016],
                    [0.74450517, -0.37123728, -0.55488276],
                    11170.608,
                ),
                (
                    [60.0, 40.0],
                    [1.0054483, 1.990382, 3.00161],
                    [0.48774019, -0.86100799, 0.1441343],
                    11170.608,
                ),
                (
                    [12.25, 31.5],
                    [1.0054314, 1.9924843, 2.9952521],
                    [0.5213623, -0.72143579, -0.45575395],
                    10417.64,
                ),
            ],
        ),
        (
            vec![],
            LANDSCAPE,
            vec![
                (
                    [0.0, 0.0],
                    [0.0035999995, 0.0023999996, 0.01],
                    [0.33040035, 0.22026691, 0.91777885],
                    10895.86,
                ),
                (
                    [12.25, 31.5],
                    [0.0021300002, -0.00138, 0.01],
                    [0.20645456, -0.13375928, 0.96927023],
                    10317.03,
                ),
            ],
        ),
        (
            vec![("focal_length", string("35mm"))],
            LANDSCAPE,
            vec![
                (
                    [0.0, 0.0],
                    [0.0051428569, 0.0034285712, 0.01],
                    [0.43746573, 0.2916438, 0.85062778],
                    11756.012,
                ),
                (
                    [12.25, 31.5],
                    [0.0030428576, -0.0019714283, 0.01],
                    [0.28606382, -0.18533705, 0.94011569],
                    10636.979,
                ),
            ],
        ),
        (fov("y"), LANDSCAPE, vec![([0.0, 0.0], long, [0.53541011, 0.35694006, 0.76546049], 13064.019)]),
        (
            fov("Smaller"),
            LANDSCAPE,
            vec![([0.0, 0.0], long, [0.53541011, 0.35694006, 0.76546049], 13064.019)],
        ),
        (fov("x"), LANDSCAPE, vec![([0.0, 0.0], wide, [0.40678126, 0.27118751, 0.87234527], 11463.34)]),
        (fov("larger"), LANDSCAPE, vec![([0.0, 0.0], wide, [0.40678126, 0.27118751, 0.87234527], 11463.34)]),
        (
            fov("diagonal"),
            LANDSCAPE,
            vec![(
                [0.0, 0.0],
                [0.0038799141, 0.0025866095, 0.01],
                [0.35163963, 0.23442644, 0.90630782],
                11033.769,
            )],
        ),
        (
            fov("smaller"),
            PORTRAIT,
            vec![(
                [0.0, 0.0],
                [0.0046630758, 0.0062174355, 0.01],
                [0.3681877, 0.490917, 0.78958112],
                12664.93,
            )],
        ),
        (
            fov("larger"),
            PORTRAIT,
            vec![
                (
                    [0.0, 0.0],
                    [0.0034973072, 0.0046630767, 0.01],
                    [0.30214903, 0.40286538, 0.86394757],
                    11574.765,
                ),
                (
                    [12.25, 31.5],
                    [0.00064117333, -0.0026812684, 0.01],
                    [0.061811414, -0.25848392, 0.96403593],
                    10373.047,
                ),
            ],
        ),
        (
            shifted,
            LANDSCAPE,
            vec![
                (
                    [0.0, 0.0],
                    [0.0033137088, 0.0038659936, 0.01],
                    [0.29529467, 0.34451044, 0.89113045],
                    11221.69,
                ),
                (
                    [60.0, 40.0],
                    [-0.0049705612, -0.0016568538, 0.01],
                    [-0.44028381, -0.14676127, 0.88578284],
                    11289.438,
                ),
                (
                    [12.25, 31.5],
                    [0.0016223369, -0.00048324899, 0.01],
                    [0.15995808, -0.047647059, 0.98597324],
                    10142.253,
                ),
            ],
        ),
        (
            clipped,
            LANDSCAPE,
            vec![
                ([0.0, 0.0], [0.2071068, 0.13807119, 0.5], [0.37080628, 0.24720418, 0.8952055], 7.2609029),
                (
                    [12.25, 31.5],
                    [0.12253819, -0.079390921, 0.5],
                    [0.23525116, -0.1524162, 0.9599095],
                    6.7714715,
                ),
            ],
        ),
    ];
    for (params, film, rows) in table {
        let name = format!("{params:?}");
        check(&name, &read("perspective", params, film, DVec3::ZERO).unwrap(), [0.5, 0.5], &rows);
    }
}

#[test]
fn lens_and_parallel_rays_are_mitsubas() {
    let params = vec![
        ("to_world", transform(view())),
        ("fov", float(45.0)),
        ("aperture_radius", float(0.2)),
        ("focus_distance", float(2.0)),
    ];
    let lens = read("thinlens", params, LANDSCAPE, DVec3::ZERO).unwrap();
    let row =
        ([12.25, 31.5], [1.0054314, 1.9924843, 2.9952521], [0.52136236, -0.72143579, -0.45575401], 10417.638);
    check("lens centre", &lens, [0.5, 0.5], &[row]);
    let row =
        ([12.25, 31.5], [1.0857251, 2.0285616, 3.127902], [0.47123688, -0.72139496, -0.50746936], 10669.535);
    check("lens", &lens, [0.1, 0.8], &[row]);
    let row =
        ([30.0, 20.0], [0.94432777, 1.9791383, 2.8519797], [0.71738976, -0.67905289, -0.15568914], 10031.939);
    check("lens", &lens, [0.9, 0.3], &[row]);

    let flat = read("orthographic", vec![], LANDSCAPE, DVec3::ZERO).unwrap();
    let rows = [
        ([0.0, 0.0], [1.0, 0.66666663, 0.01], [0.0, 0.0, 1.0], 9999.99),
        ([12.25, 31.5], [0.5916667, -0.38333324, 0.01], [0.0, 0.0, 1.0], 9999.99),
    ];
    check("orthographic", &flat, [0.5, 0.5], &rows);
    let scaled = view() * DMat4::from_scale(DVec3::new(3.0, 2.0, 4.0));
    let params = vec![("to_world", transform(scaled)), ("near_clip", float(0.5)), ("far_clip", float(9.0))];
    let flat = read("orthographic", params, LANDSCAPE, DVec3::ZERO).unwrap();
    let dir = [0.6882472, -0.6882472, -0.22941573];
    let rows = [
        ([0.0, 0.0], [2.9393044, 2.1387932, -0.31626487], dir, 8.5),
        ([60.0, 40.0], [1.8136847, -0.89178169, 5.3986015], dir, 8.5),
        ([12.25, 31.5], [1.5991364, 0.43282938, 0.78112304], dir, 8.5),
    ];
    check("orthographic, scaled", &flat, [0.5, 0.5], &rows);
}

/// What picks the middle of an opening.
fn middle(name: &str) -> Vec2 {
    if name.contains("blades") { Vec2::new(0.5, 0.0) } else { Vec2::splat(0.5) }
}

/// The header's matrices send what a pixel sees back to that pixel.
#[test]
fn matrices_agree_with_rays() {
    let (film, recentre) = (Vec2::new(60.0, 40.0), DVec3::new(1.0, 2.0, 3.0));
    let examples = Camera::examples();
    assert_eq!(examples.len(), 11);
    for (name, camera) in &examples {
        let Some(to_ndc) = camera.world_to_ndc() else { continue };
        for share in [[0.0, 0.0], [1.0, 1.0], [0.5, 0.5], [0.2, 0.9], [1.3, -0.2]] {
            // Through the middle of the lens, two thirds of the way to the far plane.
            let share = Vec2::from(share);
            let ray = camera.ray(film * share, middle(name), 0.0);
            assert!((ray.dir.length() - 1.0).abs() < 2e-7, "{name}");
            for (t, z) in
                [(0.0, Some(0.0)), (f64::from(ray.t_max) / 1.5, None), (f64::from(ray.t_max), Some(1.0))]
            {
                let p = ray.origin.as_dvec3() + ray.dir.as_dvec3() * t + recentre;
                let ndc = to_ndc * p.extend(1.0);
                let ndc = ndc.truncate() / ndc.w;
                // A millidegree wide film multiplies f32 rounding by 1e5; near
                // the lens the position itself is rounded.
                let tolerance = if name.contains("1e-3") { 1e-1 } else { 3e-4 };
                let tolerance = if t == 0.0 { 100.0 * tolerance } else { tolerance };
                let off = (ndc.truncate() - share.as_dvec2()).abs().max_element();
                assert!(off < tolerance, "{name} {share} at {t}: {ndc}");
                if let Some(z) = z {
                    assert!((ndc.z - z).abs() < 1e-3, "{name} {share} at {t}: {ndc}");
                }
                let view = camera.world_to_camera().transform_point3(p);
                assert!(view.z > 0.0, "{name}: looks along +z");
            }
        }
        let centre = camera.ray(film * 0.5, Vec2::splat(0.5), 0.0);
        let right = camera.ray(film * Vec2::new(0.75, 0.5), Vec2::splat(0.5), 0.0);
        let down = camera.ray(film * Vec2::new(0.5, 0.75), Vec2::splat(0.5), 0.0);
        let m = camera.world_to_camera();
        let at = |ray: &Ray| m.transform_point3(ray.at(0.9 * ray.t_max).as_dvec3() + recentre);
        assert!(at(&right).x > at(&centre).x && at(&down).y < at(&centre).y, "{name}: +x right, +y up");
        assert!((m.determinant() + 1.0).abs() < 1e-9, "{name}: rigid and left-handed");
        // EXR wants the translation in the last four of the sixteen numbers.
        let last = &m.to_cols_array()[12..];
        assert!((DVec3::new(last[0], last[1], last[2]) - m.transform_point3(DVec3::ZERO)).length() < 1e-12);
    }
}

#[test]
fn recentring_moves_the_rays_and_nothing_else() {
    let far = DVec3::new(1e7, -3e9, 2e5 + 0.125);
    let to_world = DMat4::from_translation(far) * view();
    for plugin in ["perspective", "orthographic"] {
        let mut d = Describe::new();
        let id = d.object(Category::Sensor, plugin, vec![("to_world", transform(to_world))]);
        let position = camera_position(&d.scene, id).unwrap();
        assert!((position - far - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-6);
        let there = Camera::from_desc(&d.scene, id, LANDSCAPE, position).unwrap();
        let here = DVec3::new(1.0, 2.0, 3.0);
        let here = read(plugin, vec![("to_world", transform(view()))], LANDSCAPE, here).unwrap();
        let film = Vec2::new(12.25, 31.5);
        let (a, b) = (there.ray(film, Vec2::ZERO, 0.0), here.ray(film, Vec2::ZERO, 0.0));
        assert!((a.origin - b.origin).length() < 1e-6 && (a.dir - b.dir).length() < 1e-6, "{plugin}");
        let p = DVec3::new(3.0, 0.5, 2.0);
        let (a, b) = (there.world_to_camera(), here.world_to_camera());
        let difference = a.transform_point3(p + far) - b.transform_point3(p);
        assert!(difference.length() < 1e-5, "{plugin}: the header speaks of the file's world");
    }
}

/// Catalogue C1: a scene times 2^k gives the same rays times 2^k.
#[test]
fn rays_scale_bit_for_bit() {
    for k in [-40, -3, 0, 17, 40] {
        let s = 2.0f64.powi(k);
        let mut to_world = view();
        to_world.w_axis = (to_world.w_axis.truncate() * s).extend(1.0);
        let params = |s: f64, m: DMat4| {
            vec![
                ("to_world", transform(m)),
                ("near_clip", float(0.01 * s)),
                ("far_clip", float(100.0 * s)),
                ("aperture_radius", float(0.2 * s)),
                ("focus_distance", float(2.0 * s)),
            ]
        };
        let scaled = read("thinlens", params(s, to_world), LANDSCAPE, DVec3::ZERO).unwrap();
        let unit = read("thinlens", params(1.0, view()), LANDSCAPE, DVec3::ZERO).unwrap();
        let (film, lens) = (Vec2::new(12.25, 31.5), Vec2::new(0.1, 0.8));
        let (a, b) = (scaled.ray(film, lens, 0.0), unit.ray(film, lens, 0.0));
        assert_eq!((a.origin, a.dir, a.t_max), (b.origin * s as f32, b.dir, b.t_max * s as f32), "2^{k}");
    }
}

/// Catalogue A22: aperture 0.2 in focus at 2; a point at 4 fills a disk of
/// radius 0.2 · (1/2 − 1/4) = 0.05 at unit distance, uniformly.
#[test]
fn circle_of_confusion_is_a_uniform_disk_of_the_right_size() {
    let params = vec![("fov", float(45.0)), ("aperture_radius", float(0.2)), ("focus_distance", float(2.0))];
    let camera = read("thinlens", params, LANDSCAPE, DVec3::ZERO).unwrap();
    let half_width = 22.5f64.to_radians().tan();
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let mut widest = 0.0f32;
    let (rings, sectors, n) = (8, 16, 100_000);
    let mut counts = vec![0u32; rings * sectors];
    for _ in 0..n {
        let lens = Vec2::new(rng.random(), rng.random());
        // The film point whose ray through this lens point meets (0, 0, 4).
        let q = concentric_disk(lens) * 0.2 / 4.0;
        widest = widest.max(q.length());
        let film = Vec2::splat(30.0) * (Vec2::ONE - q / half_width as f32) - Vec2::new(0.0, 10.0);
        let ray = camera.ray(film, lens, 0.0);
        let p = ray.at((4.0 - ray.origin.z) / ray.dir.z);
        assert!((p - Vec3::new(0.0, 0.0, 4.0)).length() < 2e-6, "{p}");
        // Where it crossed the lens.
        let on_lens = ray.at(-ray.origin.z / ray.dir.z).truncate() / 0.2;
        let ring = (on_lens.length_squared() * rings as f32) as usize;
        let turn = on_lens.y.atan2(on_lens.x) / std::f32::consts::TAU + 0.5;
        let sector = (turn * sectors as f32) as usize;
        counts[ring.min(rings - 1) * sectors + sector.min(sectors - 1)] += 1;
    }
    assert!((widest - 0.05).abs() < 1e-4, "{widest}");
    let expected = n as f32 / counts.len() as f32;
    let chi2: f32 = counts.iter().map(|c| (*c as f32 - expected).powi(2) / expected).sum();
    // 127 degrees of freedom: mean 127, standard deviation 16; 1e-3 is at 181.
    assert!(chi2 < 181.0, "χ² = {chi2} of 128 cells");
}

/// What a pixel sees is seen by that pixel, for all cameras.
#[test]
fn points_are_seen_where_their_ray_starts() {
    let (film, size) = (Vec2::new(60.0, 40.0), DVec3::new(60.0, 40.0, 0.0).truncate());
    for (name, camera) in Camera::examples() {
        for share in [[0.1, 0.2], [0.5, 0.5], [0.4, 0.7], [0.9, 0.95]] {
            let at = film * Vec2::from(share);
            let ray = camera.ray(at, middle(&name), 0.0);
            if ray.t_max == 0.0 {
                assert!(name.contains("whole sphere"));
                continue;
            }
            let found = camera.film_of(ray.at(1e3).as_dvec3(), size).unwrap();
            let tolerance = if name.contains("1e-3") { 6.0 } else { 2e-2 };
            assert!((found - at.as_dvec2()).length() < tolerance, "{name} {at}: {found}");
        }
    }
}

/// The shape of a lens's opening is the shape of what is out of focus; its
/// corners are on the circle, its width is divided by the ratio.
#[test]
fn blades_make_polygons() {
    let params = vec![
        ("fov", float(45.0)),
        ("aperture_radius", float(0.3)),
        ("focus_distance", float(2.0)),
        ("blades", Value::Int(6)),
        ("blade_rotation", float(90.0)),
        ("aperture_ratio", float(2.0)),
    ];
    let camera = read("thinlens", params, LANDSCAPE, DVec3::ZERO).unwrap();
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(2);
    let (mut widest, mut inner) = (Vec2::ZERO, 0);
    let n = 100_000;
    for _ in 0..n {
        let ray = camera.ray(Vec2::new(30.0, 20.0), Vec2::new(rng.random(), rng.random()), 0.0);
        let on_lens = ray.at(-ray.origin.z / ray.dir.z).truncate() / 0.3 * Vec2::new(2.0, 1.0);
        widest = widest.max(on_lens.abs());
        inner += u32::from(on_lens.length_squared() < 0.5);
        // Inside of all six sides, whose distance from the centre is cos 30°.
        for k in 0..6 {
            let side = Vec2::from_angle(
                (f32::from(k as u8) + 0.5) * std::f32::consts::TAU / 6.0 + 0.5 * std::f32::consts::PI,
            );
            assert!(on_lens.dot(side) < 0.75f32.sqrt() + 1e-4, "{on_lens}");
        }
        let focus = ray.at((2.0 - ray.origin.z) / ray.dir.z);
        assert!(focus.truncate().length() < 1e-5, "{focus}");
    }
    assert!((widest - Vec2::new(0.75f32.sqrt(), 1.0)).abs().max_element() < 5e-3, "{widest}");
    // The disk of half the area of the circle lies in the hexagon.
    let expected = 0.5 * std::f64::consts::PI / (1.5 * 3f64.sqrt());
    let share = f64::from(inner) / f64::from(n);
    assert!((share - expected).abs() < 4.0 * (expected / f64::from(n)).sqrt(), "{share} {expected}");
}

/// A tilted plane in focus: rays of one film point meet on it. A point in
/// focus is given by its distance or by itself.
#[test]
fn planes_in_focus() {
    let tilted = vec![
        ("fov", float(45.0)),
        ("aperture_radius", float(0.3)),
        ("focus_point", Value::Vector(DVec3::new(0.5, 0.25, 2.0))),
        ("focus_tilt_y", float(45.0)),
    ];
    let camera = read("thinlens", tilted, LANDSCAPE, DVec3::ZERO).unwrap();
    for film in [[12.0, 31.0], [30.0, 20.0], [55.0, 3.0]] {
        let film = Vec2::from(film);
        let rays = [[0.1, 0.3], [0.9, 0.2], [0.6, 0.8]].map(|u| camera.ray(film, Vec2::from(u), 0.0));
        // The plane z + x = 2.
        let meet = rays.map(|r| r.at((2.0 - r.origin.z - r.origin.x) / (r.dir.z + r.dir.x)));
        assert!((meet[0] - meet[1]).length() < 1e-5 && (meet[0] - meet[2]).length() < 1e-5, "{meet:?}");
    }
}

#[test]
fn a_closed_lens_is_a_pinhole() {
    let examples = Camera::examples();
    let find = |n: &str| &examples.iter().find(|(name, _)| name == n).unwrap().1;
    let (open, closed, pinhole) = (find("thinlens"), find("thinlens, closed"), find("perspective"));
    assert!(open.needs_lens() && !closed.needs_lens() && !pinhole.needs_lens());
    let film = Vec2::new(7.5, 33.0);
    let (a, b) = (closed.ray(film, Vec2::new(0.1, 0.8), 0.0), pinhole.ray(film, Vec2::ZERO, 0.0));
    assert!((a.dir - b.dir).length() < 1e-6 && (a.origin - b.origin).length() < 1e-6);
}

#[test]
fn refusals_say_what_and_where() {
    let message = |plugin, params| read(plugin, params, LANDSCAPE, DVec3::ZERO).unwrap_err().to_string();
    let scale = transform(DMat4::from_scale(DVec3::splat(2.0)));
    let cases: Vec<(&str, Params, &str)> = vec![
        ("perspectiv", vec![], "scene.xml:1:1: there is no sensor `perspectiv`; did you mean `perspective`?"),
        (
            "perspective",
            vec![("fov", float(180.0))],
            "scene.xml:1:2: `fov` must lie between 0 and 180 degrees, found 180",
        ),
        (
            "perspective",
            vec![("fov", float(40.0)), ("focal_length", string("50mm"))],
            "scene.xml:1:3: give either `fov` or `focal_length`, not both",
        ),
        (
            "perspective",
            vec![("focal_length", string("long"))],
            "scene.xml:1:2: `focal_length` must be a length in millimetres like `50mm`, found `long`",
        ),
        (
            "perspective",
            vec![("near_clip", float(0.0))],
            "scene.xml:1:2: `near_clip` must be greater than zero, found 0",
        ),
        (
            "orthographic",
            vec![("near_clip", float(3.0)), ("far_clip", float(2.0))],
            "scene.xml:1:3: `near_clip` (3) must be smaller than `far_clip` (2)",
        ),
        (
            "perspective",
            vec![("to_world", scale)],
            "scene.xml:1:2: `to_world` of sensor `perspective` must not scale; put the scale into the scene, \
             or use `fov`",
        ),
        ("thinlens", vec![], "scene.xml:1:1: sensor `thinlens` needs an `aperture_radius`"),
        (
            "perspective",
            vec![("shutter_open", float(1.0))],
            "scene.xml:1:2: `shutter_open` (1) must not be later than `shutter_close` (0)",
        ),
        (
            "perspective",
            vec![("fov", float(40.0)), ("fov_axis", string("z"))],
            "scene.xml:1:3: `fov_axis` has no value `z`; did you mean `x`?",
        ),
    ];
    for (plugin, params, expected) in cases {
        assert_eq!(message(plugin, params), expected);
    }
    let unknown = message("perspective", vec![("apperture_radius", float(1.0))]);
    assert!(unknown.contains("sensor `perspective` takes no parameter `apperture_radius`"), "{unknown}");
    assert!(message("thinlens", vec![("aperture_radius", float(-1.0))]).contains("must not be negative"));
}
