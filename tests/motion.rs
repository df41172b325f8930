//! Motion blur and instances: against closed forms, against the mean of still
//! pictures, and all accelerators against brute force.
#![allow(clippy::print_stdout, reason = "says what it measured")]
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod common_shape;
#[path = "common/render.rs"]
mod render;

use common_shape::{Random, soup};
use etendue::accel::Accel;
use etendue::desc::{Mesh, MeshKey};
use etendue::math::{DMat4, DQuat, DVec3, Motion, Ray, Transform, Vec3};
use etendue::shape::{Geometry, GeometryBuilder, Hit, MeshOptions};
use render::{Ready, mean, rgb};

fn place(angle: f64, axis: DVec3, scale: DVec3, at: DVec3) -> Transform {
    let rotation = DQuat::from_axis_angle(axis.normalize(), angle);
    Transform::from_matrix(DMat4::from_scale_rotation_translation(scale, rotation, at)).unwrap()
}

/// Two groups, one of which deforms from key to key, with something still beside it;
/// instances still, mirrored, moving.
fn zoo(keys: [&[f64]; 2]) -> Geometry {
    let mut random = Random::new(7);
    let mut b = GeometryBuilder::new();
    let options = MeshOptions { shutter: [0.0, 1.0], ..MeshOptions::default() };
    b.add_mesh(&soup(&mut random, 40, 0.3), &Transform::IDENTITY, options).unwrap();
    b.add_sphere(DVec3::new(0.5, 0.5, 0.0), 0.3, &Transform::IDENTITY, false).unwrap();
    let still = b.begin_group();
    b.add_mesh(&soup(&mut random, 60, 0.4), &Transform::IDENTITY, options).unwrap();
    b.add_cylinder([DVec3::ZERO, DVec3::Y], 0.2, &Transform::IDENTITY, false).unwrap();
    let moving = b.begin_group();
    b.add_mesh(&soup(&mut random, 30, 0.4), &Transform::IDENTITY, options).unwrap();
    let at = |time: f64, random: &mut Random, mesh: &Mesh| {
        let positions = mesh.positions.iter().map(|p| *p + random.vector() * 0.3).collect();
        MeshKey { time, positions, normals: Vec::new() }
    };
    for keys in keys {
        let mut mesh = soup(&mut random, 50, 0.4);
        mesh.deformation = keys.iter().map(|t| at(*t, &mut random, &mesh)).collect();
        mesh.positions = mesh.deformation[0].positions.clone();
        b.add_mesh(&mesh, &Transform::IDENTITY, options).unwrap();
    }
    let [x, y] = [DVec3::X, DVec3::new(1.0, 2.0, -1.0)];
    let one = place(0.3, y, DVec3::new(0.5, 0.7, 0.6), x * 1.5);
    let two = place(2.3, y, DVec3::new(-0.5, 0.9, 0.6), -x);
    let motion = Motion::new(&[(0.0, one), (0.4, two), (1.0, place(0.0, x, DVec3::ONE, y))]).unwrap();
    b.add_instance(still, Motion::still(one));
    b.add_instance(still, Motion::still(one));
    b.add_instance(still, motion.clone());
    b.add_instance(moving, Motion::still(two));
    b.add_instance(moving, motion);
    b.finish()
}

fn bits(hit: Option<Hit>) -> Option<(u32, u32, u32, u32, u32)> {
    hit.map(|h| (h.t.to_bits(), h.prim, h.instance, h.u.to_bits(), h.v.to_bits()))
}

#[test]
fn accelerators_agree_on_instances_and_motion() {
    let many: Vec<f64> = (0..=40).map(|i| (f64::from(i) / 40.0).powi(2)).collect();
    for keys in
        [[&[0.0, 0.3, 0.9, 1.0][..]; 2], [&[0.0, 0.3, 1.0], &[0.0, 0.5, 0.7, 1.0]], [&[0.0, 1.0], &many]]
    {
        accelerators_agree(&zoo(keys));
    }
}

fn accelerators_agree(geometry: &Geometry) {
    let kinds: Vec<Accel> =
        Accel::NAMES.iter().map(|n| Accel::build_named(Some(n), geometry).unwrap()).collect();
    let mut random = Random::new(8);
    let (mut hits, mut inside, mut start) = (0, 0, None::<Ray>);
    for i in 0..40_000 {
        let origin = random.vector() * 3.0;
        let mut ray = Ray::new(origin, random.vector() - origin);
        ray.time = if i % 5 == 0 { (random.below(11) as f32) / 10.0 } else { random.unit() };
        if let (0, Some(next)) = (i % 3, start) {
            ray = next;
        }
        if i % 4 == 0 {
            ray.t_max = random.unit() * 3.0;
        }
        let expected = kinds[0].closest(geometry, &ray);
        for accel in &kinds {
            let found = accel.closest(geometry, &ray);
            assert_eq!(bits(found), bits(expected), "{} {ray:?}\n{found:?} {expected:?}", accel.name());
            assert_eq!(accel.occluded(geometry, &ray), expected.is_some(), "{} {ray:?}", accel.name());
        }
        start = expected.map(|hit| {
            hits += 1;
            inside += usize::from(hit.instance != Hit::NO_INSTANCE);
            geometry.surface(&ray, &hit).spawn(random.direction())
        });
    }
    assert!(hits > 10_000 && inside > 6_000, "{hits} {inside}");
}

/// No ray that leaves a convex body in an instance meets it again, whatever
/// the scale of either space and wherever it is.
#[test]
fn rays_leave_instances() {
    let mut random = Random::new(9);
    let ball = common_shape::sphere_mesh(12, 24, 1.0, Vec3::ZERO);
    for (scale, at) in [(1.0, 0.0), (1e-6, 1e-3), (1e6, 1e5), (1.0, 1e3), (37.0, 2e4)] {
        for local in [1.0, 1e-4, 1e5] {
            let mut b = GeometryBuilder::new();
            let group = b.begin_group();
            let size = Transform::from_matrix(DMat4::from_scale(DVec3::splat(local))).unwrap();
            b.add_mesh(&ball, &size, MeshOptions { face_normals: true, ..MeshOptions::default() }).unwrap();
            let start = DVec3::new(0.3, -1.0, 0.7) * at;
            let a = place(0.5, DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 0.5) * scale / local, start);
            let b2 = place(1.5, DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 1.0, 0.5) * scale / local, start);
            b.add_instance(group, Motion::new(&[(0.0, a), (1.0, b2)]).unwrap());
            let geometry = b.finish();
            let accel = Accel::build_named(None, &geometry).unwrap();
            let (centre, radius) = geometry.bounds().bounding_sphere();
            let mut left = 0;
            for _ in 0..4_000 {
                let origin = centre + random.direction() * radius * 2.0;
                let mut ray = Ray::new(origin, centre + random.vector() * radius * 0.3 - origin);
                ray.time = random.unit();
                let Some(hit) = accel.closest(&geometry, &ray) else { continue };
                let surface = geometry.surface(&ray, &hit);
                let dir = random.direction();
                let dir = if dir.dot(surface.ng) < 0.0 { -dir } else { dir };
                let again = accel.closest(&geometry, &surface.spawn(dir));
                assert!(
                    again.is_none(),
                    "scale {scale} at {at} local {local}: {surface:?} {dir:?} {again:?}"
                );
                left += 1;
            }
            assert!(left > 1_000, "{left} scale {scale} at {at} local {local}");
        }
    }
}

/// What a box filter sees of a white plate as wide as `width` pixels that goes
/// from pixel `from` to pixel `to` (its left edge) while the shutter is open.
fn coverage(pixel: f64, from: f64, to: f64, width: f64) -> f64 {
    // The mean over time of the overlap, by fine quadrature.
    let n = 4000;
    let overlap = |left: f64| ((left + width).min(pixel + 1.0) - left.max(pixel)).max(0.0);
    (0..n).map(|i| overlap(from + (to - from) * (f64::from(i) + 0.5) / f64::from(n))).sum::<f64>()
        / f64::from(n)
}

fn plates(to_world: &str, camera: &str, shutter: &str) -> String {
    format!(
        r#"<scene version="3.0.0">
        <integrator type="path"/>
        <sensor type="orthographic">{camera}{shutter}
          <film type="hdrfilm"><integer name="width" value="20"/><integer name="height" value="4"/>
            <rfilter type="box"/></film>
        </sensor>
        <shape type="rectangle">{to_world}
          <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>
        </scene>"#
    )
}

const STILL_CAMERA: &str =
    r#"<transform name="to_world"><lookat origin="0,0,-5" target="0,0,0" up="0,1,0"/></transform>"#;
const SHUTTER: &str = r#"<float name="shutter_open" value="2"/><float name="shutter_close" value="4"/>"#;

/// An orthographic film of 20 × 4 pixels shows x in ±1 from the left (+1) to
/// the right (−1).
#[test]
fn a_moving_plate_covers_a_ramp() {
    for speed in [0.0, 0.1, 3.0, 10.0] {
        let key = |time: f64, pixels: f64| {
            let x = 1.0 - (4.0 + 2.0 + pixels) * 0.1;
            // Turned round to face the camera, 4 pixels wide.
            format!(
                r#"<transform time="{time}"><rotate y="1" angle="180"/><scale x="0.2" y="3"/><translate x="{x}"/></transform>"#
            )
        };
        let motion =
            format!(r#"<animation name="to_world">{}{}</animation>"#, key(2.0, 0.0), key(4.0, speed));
        let ready = Ready::from_xml(&plates(&motion, STILL_CAMERA, SHUTTER), None, None);
        assert_eq!(ready.scene.plan.motion, speed > 0.0);
        let picture = rgb(&ready.picture(8192, 1));
        for x in 0..20 {
            let expected = coverage(x as f64, 4.0, 4.0 + speed, 4.0);
            let found = (0..4).map(|y| f64::from(picture[3 * (20 * y + x)])).sum::<f64>() / 4.0;
            assert!((found - expected).abs() < 4e-3, "{speed} px: pixel {x}: {found} for {expected}");
        }
    }
}

/// The same picture when the camera goes the other way.
#[test]
fn a_moving_camera_is_a_moving_scene() {
    let plate = r#"<transform name="to_world"><rotate y="1" angle="180"/><scale x="0.2" y="3"/>
        <translate x="0.4"/></transform>"#;
    let key = |time: f64, x: f64| {
        format!(
            r#"<transform time="{time}"><lookat origin="{x},0,-5" target="{x},0,0" up="0,1,0"/></transform>"#
        )
    };
    let camera = format!(r#"<animation name="to_world">{}{}</animation>"#, key(2.0, 0.0), key(4.0, 0.5));
    let ready = Ready::from_xml(&plates(plate, &camera, SHUTTER), None, None);
    assert!(ready.scene.camera_moves());
    let mut o = render::options(4, 1);
    o.layers.motion = true;
    let layers = ready.render(&o).film.resolve();
    // Where a sample has hit the plate, it goes 5 pixels to the right.
    let (right, down) = (layers.channel("forward.u").unwrap(), layers.channel("forward.v").unwrap());
    let most = right.iter().copied().fold(0.0f32, f32::max);
    assert!((most - 5.0).abs() < 1e-3 && down.iter().all(|v| v.abs() < 1e-3), "{most}");
    let picture = rgb(&ready.picture(8192, 1));
    for x in 0..20 {
        let expected = coverage(x as f64, 4.0, 9.0, 4.0);
        let found = (0..4).map(|y| f64::from(picture[3 * (20 * y + x)])).sum::<f64>() / 4.0;
        assert!((found - expected).abs() < 4e-3, "pixel {x}: {found} for {expected}");
    }
}

/// The picture of a scene of 20 × 4 pixels against the share of the shutter's time during
/// which points of a pixel are covered: `covered(right, up, time)`, ±1 and ±0.2 at the
/// borders.
fn check_coverage(name: &str, scene: &str, covered: impl Fn(f64, f64, f64) -> bool) {
    let ready = Ready::from_xml(scene, None, None);
    assert!(ready.scene.plan.motion, "{name}");
    let picture = rgb(&ready.picture(32768, 1));
    let middle = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
    const PLACES: usize = 16;
    const TIMES: usize = 512;
    let (mut between, mut seen, mut worst) = (0, 0.0, 0.0_f64);
    for (i, found) in picture.iter().step_by(3).enumerate() {
        let (column, row) = (i % 20, i / 20);
        let mut count = 0;
        for place in 0..PLACES * PLACES {
            let right = (column as f64 + middle(place % PLACES, PLACES)) * 0.1 - 1.0;
            let up = 0.2 - (row as f64 + middle(place / PLACES, PLACES)) * 0.1;
            count += (0..TIMES).filter(|k| covered(right, up, middle(*k, TIMES))).count();
        }
        let expected = count as f64 / (PLACES * PLACES * TIMES) as f64;
        let found = f64::from(*found);
        assert!((found - expected).abs() < 4e-3, "{name}: pixel {column}, {row}: {found} for {expected}");
        worst = worst.max((found - expected).abs());
        between += usize::from(expected > 0.02 && expected < 0.98);
        seen += expected;
    }
    println!("{name}: {between} pixels are covered for a while, off by {worst:.5} at most");
    assert!(between > 30 && seen > 5.0, "{name}: only {between} pixels are covered for a while");
}

/// A bar that turns about its middle, by unequal angles in unequal times.
#[test]
fn a_turning_bar_covers_by_its_angle() {
    let keys = [(2.0, 10.0), (2.5, 40.0), (4.0, 170.0)];
    let key = |(time, angle): (f64, f64)| {
        format!(
            r#"<transform time="{time}"><rotate y="1" angle="180"/><scale x="3" y="0.15"/><rotate z="1" angle="{angle}"/></transform>"#
        )
    };
    let motion = format!(r#"<animation name="to_world">{}</animation>"#, keys.map(key).concat());
    check_coverage("turning", &plates(&motion, STILL_CAMERA, SHUTTER), |right, up, time| {
        let angle = if time < 0.25 { 10.0 + 120.0 * time } else { 40.0 + 130.0 * (time - 0.25) / 0.75 };
        let (sin, cos) = f64::to_radians(angle).sin_cos();
        // Seen from −z, x goes to the left.
        (right * sin + up * cos).abs() < 0.15
    });
}

/// A plate that grows, and a camera that comes nearer to one.
#[test]
fn a_zoom_covers_by_the_scale() {
    let key = |time: f64, width: f64| {
        format!(
            r#"<transform time="{time}"><rotate y="1" angle="180"/><scale x="{width}" y="3"/></transform>"#
        )
    };
    let motion = format!(r#"<animation name="to_world">{}{}</animation>"#, key(2.0, 0.1), key(4.0, 0.9));
    check_coverage("growing", &plates(&motion, STILL_CAMERA, SHUTTER), |right, _, time| {
        right.abs() < 0.1 + 0.8 * time
    });

    let plate =
        r#"<transform name="to_world"><rotate y="1" angle="180"/><scale x="0.5" y="30"/></transform>"#;
    let key = |time: f64, z: f64| {
        format!(
            r#"<transform time="{time}"><lookat origin="0,0,{z}" target="0,0,0" up="0,1,0"/></transform>"#
        )
    };
    let camera = format!(r#"<animation name="to_world">{}{}</animation>"#, key(2.0, -8.0), key(4.0, -2.0));
    let scene = plates(plate, &camera, SHUTTER)
        .replace(r#"type="orthographic">"#, r#"type="perspective"><float name="fov" value="40"/>"#);
    let half = f64::to_radians(20.0).tan();
    check_coverage("approach", &scene, |right, _, time| right.abs() * half * (8.0 - 6.0 * time) < 0.5);
}

/// A scene in which all kinds of motion happen: a turning plate, a sphere that
/// grows, a group in a group, and a camera that zooms in.
fn busy(shutter: [f64; 2]) -> String {
    let [open, close] = shutter;
    format!(
        r#"<scene version="3.0.0">
        <integrator type="path"><integer name="max_depth" value="4"/></integrator>
        <sensor type="perspective"><float name="fov" value="40"/>
          <animation name="to_world">
            <transform time="0"><lookat origin="0,2,-9" target="0,0,0" up="0,1,0"/></transform>
            <transform time="1"><lookat origin="1,1,-6" target="0,0.3,0" up="0,1,0"/></transform>
          </animation>
          <float name="shutter_open" value="{open}"/><float name="shutter_close" value="{close}"/>
          <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/>
            <rfilter type="box"/></film>
        </sensor>
        <emitter type="constant"><rgb name="radiance" value="0.6"/></emitter>
        <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/>
          <translate y="-1"/></transform></shape>
        <shape type="cube"><bsdf type="diffuse"><rgb name="reflectance" value="0.8,0.3,0.2"/></bsdf>
          <animation name="to_world">
            <transform time="0"><scale x="1.6" y="0.1" z="0.5"/></transform>
            <transform time="0.5"><scale x="1.6" y="0.1" z="0.5"/><rotate y="1" angle="100"/></transform>
            <transform time="1"><scale x="1" y="0.3" z="0.5"/><rotate y="1" angle="200"/><translate y="1"/></transform>
          </animation></shape>
        <shape type="sphere"><float name="radius" value="0.5"/><bsdf type="conductor"/>
          <animation name="to_world">
            <transform time="0"><translate x="-2"/></transform>
            <transform time="1"><scale value="2"/><translate x="-1" y="1"/></transform>
          </animation></shape>
        <shape type="sphere"><float name="radius" value="0.2"/>
          <emitter type="area"><rgb name="radiance" value="3,4,5"/></emitter>
          <animation name="to_world">
            <transform time="0"><translate x="2" z="-1"/></transform>
            <transform time="1"><translate x="1" y="1.5" z="-1"/></transform>
          </animation></shape>
        <shape type="shapegroup" id="pair">
          <shape type="sphere"><float name="radius" value="0.3"/></shape>
          <shape type="cube"><animation name="to_world">
            <transform time="0"><scale value="0.2"/><translate y="0.5"/></transform>
            <transform time="1"><scale value="0.2"/><translate y="0.5"/><rotate z="1" angle="180"/></transform>
          </animation></shape>
        </shape>
        <shape type="instance"><ref id="pair"/><transform name="to_world"><translate x="2" z="1"/></transform></shape>
        <shape type="instance"><ref id="pair"/><animation name="to_world">
            <transform time="0"><translate x="1" z="-2"/></transform>
            <transform time="1"><rotate x="1" angle="90"/><translate x="2.5" z="-2"/></transform></animation></shape>
        </scene>"#
    )
}

/// The blurred picture against the mean of 256 still ones.
#[test]
fn the_blur_is_the_mean_of_stills() {
    const STILLS: u32 = 256;
    let mut sum = vec![0.0; 24 * 16 * 3];
    let mut squares = sum.clone();
    for i in 0..STILLS {
        let time = (f64::from(i) + 0.5) / f64::from(STILLS);
        let ready = Ready::from_xml(&busy([time, time]), None, None);
        assert!(!ready.scene.plan.motion && ready.scene.plan.instances == 2);
        for (s, v) in sum.iter_mut().zip(rgb(&ready.picture(32, 100 + u64::from(i)))) {
            *s += f64::from(v) / f64::from(STILLS);
        }
    }
    let seeds = 16;
    let ready = Ready::from_xml(&busy([0.0, 1.0]), None, None);
    assert!(ready.scene.plan.motion && ready.scene.plan.placed_lights == 1);
    assert_eq!(ready.scene.plan.unsampled_lights, 0);
    let pictures: Vec<Vec<f32>> = (0..seeds).map(|seed| rgb(&ready.picture(512, seed))).collect();
    let (mut worst, mut mean_difference, mut level) = (0.0_f64, 0.0, 0.0);
    for (i, still) in sum.iter().enumerate() {
        let values = pictures.iter().map(|p| f64::from(p[i]));
        let blurred = values.clone().sum::<f64>() / seeds as f64;
        squares[i] = values.map(|v| (v - blurred).powi(2)).sum::<f64>() / (seeds as f64 - 1.0) / seeds as f64;
        // Both have as many samples; the stills are stratified in time.
        let error = (2.0 * squares[i]).sqrt().max(2e-4);
        worst = worst.max((blurred - still).abs() / error);
        mean_difference += (blurred - still) / sum.len() as f64;
        level += still / sum.len() as f64;
    }
    let error = (2.0 * squares.iter().sum::<f64>()).sqrt() / sum.len() as f64;
    println!(
        "mean {level:.5}, difference {mean_difference:.2e} of ± {error:.2e}; worst pixel {worst:.2} sigma"
    );
    assert!(mean_difference.abs() < 4.0 * error + 1e-4 * level, "{mean_difference} ± {error}");
    // 1152 values: 6 sigma of a t-distribution with 15 degrees of freedom.
    assert!(worst < 7.0, "{worst}");
}

/// A group placed by an instance against the same shapes placed by themselves.
#[test]
fn an_instance_is_the_group_itself() {
    let shapes = r#"<shape type="sphere"><float name="radius" value="0.7"/></shape>
        <shape type="cube"><bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf>
          <transform name="to_world"><scale value="0.4"/><rotate y="1" angle="30"/><translate x="1.3"/></transform></shape>"#;
    let scene = |inner: &str| {
        format!(
            r#"<scene version="3.0.0"><integrator type="path"/>
            <sensor type="perspective"><float name="fov" value="40"/>
              <transform name="to_world"><lookat origin="0,2,-6" target="0.5,0,0" up="0,1,0"/></transform>
              <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/></film>
            </sensor>
            <emitter type="constant"/>
            <emitter type="point"><point name="position" x="3" y="4" z="-2"/><rgb name="intensity" value="20"/></emitter>
            {inner}</scene>"#
        )
    };
    let own = Ready::from_xml(&scene(shapes), None, None);
    let instance = format!(
        r#"<shape type="shapegroup" id="g">{shapes}</shape><shape type="instance"><ref id="g"/></shape>"#
    );
    let inside = Ready::from_xml(&scene(&instance), None, None);
    let (a, b) = (own.picture(256, 1), inside.picture(256, 1));
    // The same random numbers: the pictures differ by rounding.
    let (x, y) = (rgb(&a), rgb(&b));
    let far = x.iter().zip(&y).filter(|(a, b)| (**a - **b).abs() > 2e-2 * a.max(0.1)).count();
    assert!(far < x.len() / 100, "{far} of {}", x.len());
    assert!((mean(&a) / mean(&b) - 1.0).abs() < 1e-4, "{} {}", mean(&a), mean(&b));
}

/// A moving lamp is sampled: integrators without scattered rays for it find it.
#[test]
fn a_moving_lamp_is_sampled() {
    let ready = |name| Ready::from_xml(&busy([0.0, 1.0]), Some(name), None);
    for name in ["whitted", "direct"] {
        assert!(mean(&ready(name).picture(4, 1)) > 0.0, "{name}");
    }
}

/// A lamp that deforms is found by scattered rays; an integrator that has none
/// for it says so instead of leaving it dark.
#[test]
fn a_deforming_lamp_needs_scattered_rays() {
    let xml = r#"<scene version="3.0.0"><integrator type="whitted"/><sensor type="perspective">
        <float name="shutter_close" value="1"/></sensor>
        <shape type="obj"><string name="filename" value="lamp.obj"/><emitter type="area"/></shape></scene>"#;
    let mut desc = etendue::load::load_str(xml, &render::package("tests/data"), &Default::default()).unwrap();
    let mut mesh = (*desc.meshes[0]).clone();
    let key = |time: f64, scale: f32| MeshKey {
        time,
        positions: mesh.positions.iter().map(|p| *p * scale).collect(),
        normals: mesh.normals.clone(),
    };
    mesh.deformation = vec![key(0.0, 1.0), key(1.0, 1.5)];
    desc.meshes[0] = std::sync::Arc::new(mesh);
    let whitted = Ready::build(&desc, None, None);
    assert_eq!((whitted.scene.plan.placed_lights, whitted.scene.plan.unsampled_lights), (0, 1));
    let error = etendue::render::render(
        &whitted.scene,
        &whitted.integrator,
        &render::options(1, 1),
        &etendue::render::Quiet,
    );
    let message = error.err().map(|e| e.to_string()).unwrap_or_default();
    assert!(message.contains("`whitted` cannot find lights that are curves, deform"), "{message}");
}

/// Lamps in groups that are instanced, nested and on the move over a floor.
fn lamps(integrator: &str) -> String {
    format!(
        r#"<scene version="3.0.0">{integrator}
        <sensor type="perspective"><float name="fov" value="50"/>
          <transform name="to_world"><lookat origin="0,3,-7" target="0,0.3,0" up="0,1,0"/></transform>
          <float name="shutter_close" value="1"/>
          <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/>
            <rfilter type="box"/></film></sensor>
        <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="6"/></transform></shape>
        <shape type="sphere"><point name="center" x="0" y="0.6" z="0"/><float name="radius" value="0.6"/>
          <bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></shape>
        <shape type="shapegroup" id="lamp">
          <shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="90"/></transform>
            <emitter type="area"><rgb name="radiance" value="4,3,2"/></emitter></shape>
          <shape type="sphere"><point name="center" x="0.4" y="0.3" z="0"/><float name="radius" value="0.15"/>
            <emitter type="area"><rgb name="radiance" value="2,3,6"/></emitter></shape>
          <shape type="obj"><string name="filename" value="lamp.obj"/>
            <transform name="to_world"><scale value="0.2"/><translate x="-0.8"/></transform>
            <emitter type="area"><rgb name="radiance" value="3"/></emitter></shape>
        </shape>
        <shape type="shapegroup" id="two">
          <shape type="instance"><ref id="lamp"/><transform name="to_world"><scale x="1.5" y="0.7" z="-1"/></transform></shape>
          <shape type="instance"><ref id="lamp"/><transform name="to_world"><rotate z="1" angle="40"/>
            <translate x="1.6"/></transform></shape>
        </shape>
        <shape type="instance"><ref id="two"/><transform name="to_world"><translate x="-2" y="1.6" z="0.5"/></transform></shape>
        <shape type="instance"><ref id="two"/><animation name="to_world">
          <transform time="0"><translate x="0.5" y="1.8"/></transform>
          <transform time="1"><rotate y="1" angle="70"/><translate x="1.5" y="1.4" z="-1"/></transform>
        </animation></shape>
        </scene>"#
    )
}

/// What light samples alone find, scattered rays alone, and both together is the
/// same, pixel by pixel.
#[test]
fn instanced_lamps_are_found_alike_by_both_strategies() {
    let runs = 16;
    let pictures = |lights: u32, bsdfs: u32, samples: u64| -> Vec<Vec<f64>> {
        let integrator = format!(
            r#"<integrator type="direct"><integer name="emitter_samples" value="{lights}"/>
               <integer name="bsdf_samples" value="{bsdfs}"/></integrator>"#
        );
        let ready = Ready::from_xml(&lamps(&integrator), None, None);
        assert_eq!((ready.scene.plan.placed_lights, ready.scene.plan.unsampled_lights), (12, 0));
        assert!(ready.scene.selection.is_fine());
        let luminance = |c: &[f32]| f64::from(c[0] + c[1] + c[2]);
        (0..runs)
            .map(|seed| rgb(&ready.picture(samples, seed)).chunks_exact(3).map(luminance).collect())
            .collect()
    };
    let moments = |set: &[Vec<f64>], i: Option<usize>| {
        let of = |p: &Vec<f64>| i.map_or_else(|| p.iter().sum(), |i| p[i]);
        let mean = set.iter().map(of).sum::<f64>() / set.len() as f64;
        let squares: f64 = set.iter().map(|p| (of(p) - mean).powi(2)).sum();
        (mean, squares / (set.len() as f64 - 1.0) / set.len() as f64)
    };
    let [scattered, sampled, both] = [pictures(0, 4, 512), pictures(1, 0, 128), pictures(1, 1, 64)];
    for (name, set) in [("light samples", &sampled), ("both", &both)] {
        let z = |i| {
            let ((a, va), (b, vb)) = (moments(&scattered, i), moments(set, i));
            if a == b { 0.0 } else { (a - b) / (va + vb).sqrt() }
        };
        assert!(z(None).abs() < 4.0, "{name}: z = {} for the whole picture", z(None));
        let each: Vec<f64> = (0..16 * 12).map(|i| z(Some(i))).collect();
        let covered = each.iter().filter(|z| **z != 0.0).count();
        let square = each.iter().map(|z| z * z).sum::<f64>() / covered as f64;
        println!("{name}: whole z {:.2}, mean z² {square:.3} of {covered} pixels", z(None));
        assert!(covered > 100 && (0.6..1.5).contains(&square), "{name}: z² has mean {square} of {covered}");
        assert!(each.iter().all(|z| z.abs() < 6.5), "{name}: {each:?}");
    }
}

/// A swarm of glowing instances is left to scattered rays; one lamp that moves
/// beside it is not.
#[test]
fn a_swarm_does_not_take_the_key_light_along() {
    let mut xml = String::from(
        r#"<scene version="3.0.0"><integrator type="path"/><sensor type="perspective">
        <float name="shutter_close" value="1"/></sensor>
        <shape type="sphere"><emitter type="area"/><animation name="to_world"><transform time="0"/>
        <transform time="1"><translate x="1"/></transform></animation></shape>
        <shape type="shapegroup" id="g0"><shape type="rectangle"><emitter type="area"/></shape></shape>"#,
    );
    // 40^3 + more than 2^16 instances by nesting.
    for level in 1..=3 {
        xml += &format!(r#"<shape type="shapegroup" id="g{level}">"#);
        for i in 0..41 {
            let inner = level - 1;
            xml += &format!(
                r#"<shape type="instance"><ref id="g{inner}"/><transform name="to_world"><translate x="{i}"/></transform></shape>"#
            );
        }
        xml += "</shape>";
    }
    xml += r#"<shape type="instance"><ref id="g3"/></shape></scene>"#;
    let scene = Ready::from_xml(&xml, None, None).scene;
    assert_eq!((scene.plan.placed_lights, scene.plan.unsampled_lights), (1, 41 * 41 * 41));
    assert!(scene.plan.to_string().contains("68921 more deform or are too many instances"), "{}", scene.plan);
}

#[test]
fn what_cannot_move_says_so() {
    let scene = |inner: &str| {
        let xml = format!(r#"<scene version="3.0.0"><sensor type="perspective"/>{inner}</scene>"#);
        let desc = etendue::load::load_str(&xml, std::path::Path::new(""), &Default::default()).unwrap();
        etendue::scene::Scene::build(&desc, &Default::default()).unwrap_err().to_string()
    };
    let keys = r#"<animation name="to_world"><transform time="0"/><transform time="1"><translate x="1"/></transform></animation>"#;
    let projector = scene(&format!(r#"<emitter type="projector">{keys}</emitter>"#));
    assert_eq!(
        projector,
        "<string>:1:78: emitter `projector` cannot move; shapes, instances, sensors and emitters `point`, `spot`, \
         `directional` can"
    );
    let other = scene(r#"<shape type="instance"><shape type="sphere"/></shape>"#);
    assert!(other.contains("an `instance` places a `shapegroup`, found `sphere`"), "{other}");
    let zoom = r#"<scene version="3.0.0"><sensor type="perspective"><float name="shutter_close" value="1"/>
        <animation name="to_world"><transform time="0"/><transform time="1"><scale value="2"/></transform></animation>
        </sensor></scene>"#;
    let desc = etendue::load::load_str(zoom, std::path::Path::new(""), &Default::default()).unwrap();
    let zoom = etendue::scene::Scene::build(&desc, &Default::default()).unwrap_err().to_string();
    assert!(zoom.contains("`to_world` of sensor `perspective` must not scale"), "{zoom}");
    let inner = scene(r#"<shape type="shapegroup"><shape type="shapegroup"/></shape>"#);
    assert!(inner.contains("cannot stand in another"), "{inner}");
}
