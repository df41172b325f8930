//! A1 to A14 and A25: light of known irradiance E on a floor of reflectance ½,
//! whose radiance is then E / 2π.

use std::f64::consts::PI;

use super::Row;
use super::rays::Random;
use super::sheet::Sheet;
use super::stage::{FLOOR, Still, diffuse, glow, ortho, path, path_unended, twosided};
use crate::desc::{Mesh, Result};
use crate::math::{DVec3, Vec3};

pub(super) const ROWS: &[Row] = &[
    Row { id: "A1", what: "a point light over a floor, near and far", run: point },
    Row { id: "A2", what: "a sphere light seen under any angle", run: sphere_far },
    Row { id: "A3", what: "a sphere light that almost touches", run: sphere_near },
    Row { id: "A4", what: "the sun in SI units", run: sun },
    Row { id: "A5", what: "a sphere light at a slant", run: slant },
    Row { id: "A6", what: "a disk light, wide and small, near and far", run: disk },
    Row { id: "A7", what: "a square light", run: square },
    Row { id: "A8", what: "a strip of light of aspect 1e12", run: strip },
    Row { id: "A9", what: "random triangle lights against Lambert's formula", run: triangles },
    Row { id: "A10", what: "form factors of disks and squares", run: form_factors },
    Row { id: "A11", what: "an integrating sphere of any size", run: integrating_sphere },
    Row { id: "A12", what: "a closed glowing cube, to albedo 0.99", run: glowing_cube },
    Row { id: "A13", what: "a closed glowing sphere of any size", run: glowing_sphere },
    Row { id: "A14", what: "the power of a spot in an integrating sphere", run: spot },
    Row { id: "A25", what: "surroundings with all light in one texel", run: texel },
];

/// A camera at this height that looks at the origin past what is above it.
fn low(height: f64) -> [f64; 3] {
    [0.6 * height, height, 0.0]
}

/// Light once reflected at most.
fn direct(body: String, height: f64) -> Still {
    Still::new(body, low(height), [0.0; 3]).integrator(path(2))
}

fn sphere(centre: [f64; 3], radius: f64, radiance: f64) -> String {
    let [x, y, z] = centre;
    format!(
        r#"<shape type="sphere"><point name="center" x="{x:e}" y="{y:e}" z="{z:e}"/>
        <float name="radius" value="{radius:e}"/>{}</shape>"#,
        glow(radiance)
    )
}

fn point(sheet: &mut Sheet) -> Result<()> {
    for height in [1e-3, 1.0, 1e3, 1e6] {
        let body = format!(
            r#"{FLOOR}<emitter type="point"><point name="position" x="0" y="{height:e}" z="0"/>
            <rgb name="intensity" value="{:e}"/></emitter>"#,
            height * height
        );
        let still = direct(body, 0.5 * f64::min(height, 1.0)).samples(16);
        let means = sheet.shop.means(&still)?.values;
        let name = format!("h = {height:e}");
        sheet.shop.offer(&name, &still, 0.5 / PI)?;
        sheet.within(name, 0.5 / PI, means[0], 2e-5);
    }
    Ok(())
}

fn sphere_far(sheet: &mut Sheet) -> Result<()> {
    for ratio in [0.25, 0.05, 5e-3, 5e-4, 5e-5, 5e-7, 1e-12] {
        let body = format!("{FLOOR}{}", sphere([0.0, 1.0, 0.0], ratio, (1.0 / ratio).powi(2)));
        sheet.radiance(format!("r/h = {ratio:e}"), 0.5, &direct(body, 0.5))?;
    }
    Ok(())
}

fn sphere_near(sheet: &mut Sheet) -> Result<()> {
    let cases = [
        ("r/h = 0.999", 0.999, 1.0),
        ("r/h = 0.9999", 0.9999, 1.0),
        ("r/h = 0.99999", 0.99999, 1.0),
        ("r = 1e3 at a gap of 1", 1e3, 1001.0),
        ("r = 1e5 at a gap of 1", 1e5, 100_001.0),
    ];
    for (name, radius, height) in cases {
        let body = format!("{FLOOR}{}", sphere([0.0, height, 0.0], radius, (height / radius).powi(2)));
        sheet.radiance(name, 0.5, &direct(body, 0.4 * (height - radius)).samples(256))?;
    }
    Ok(())
}

fn sun(sheet: &mut Sheet) -> Result<()> {
    let (radius, distance) = (6.96e8, 1.496e11);
    let body = format!("{FLOOR}{}", sphere([0.0, distance, 0.0], radius, (distance / radius).powi(2)));
    sheet.radiance("6.96e8 m at 1.496e11 m", 0.5, &direct(body, 0.5))
}

fn slant(sheet: &mut Sheet) -> Result<()> {
    let body = format!("{FLOOR}{}", sphere([1.5, 1.5, 0.0], 0.5, 10.0));
    let still = Still::new(body, [-0.3, 0.5, 0.0], [0.0; 3]).integrator(path(2));
    sheet.radiance("r = 0.5 at 45 degrees", 0.196_418_550, &still.samples(256))
}

fn disk(sheet: &mut Sheet) -> Result<()> {
    for (radius, height) in [(1.0, 1.0), (1e-3, 1.0), (1e3, 1.0), (1.0, 1e-3), (1e-6, 1.0)] {
        let form = radius * radius / (radius * radius + height * height);
        let body = format!(
            r#"{FLOOR}<shape type="disk"><transform name="to_world"><rotate x="1" angle="90"/>
            <scale value="{radius:e}"/><translate y="{height:e}"/></transform>{}</shape>"#,
            glow(1.0 / form)
        );
        let still = direct(body, 0.3 * height).samples(1024);
        sheet.radiance(format!("r = {radius:e}, h = {height:e}"), 0.5, &still)?;
    }
    Ok(())
}

/// Form factor of a plane element to a rectangle of half-sizes a and b that
/// faces it at unit distance, centred (Howell's catalogue, B-4, four times).
fn rectangle_factor(a: f64, b: f64) -> f64 {
    let (p, q) = (a.hypot(1.0), b.hypot(1.0));
    2.0 / PI * (a / p * (b / p).atan() + b / q * (a / q).atan())
}

fn square(sheet: &mut Sheet) -> Result<()> {
    let body = format!(
        r#"{FLOOR}<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/>
        <translate y="1"/></transform>{}</shape>"#,
        glow(1.0)
    );
    sheet.radiance("2 x 2 at 1", 0.554_126_424 * 0.5, &direct(body, 0.5).samples(256))
}

fn strip(sheet: &mut Sheet) -> Result<()> {
    for (a, b) in [(1e-6, 1e6), (1e-3, 1e3)] {
        let body = format!(
            r#"{FLOOR}<shape type="rectangle"><transform name="to_world"><scale x="{a:e}" y="{b:e}"/>
            <rotate x="1" angle="90"/><translate y="1"/></transform>{}</shape>"#,
            glow(1.0 / rectangle_factor(a, b))
        );
        sheet.radiance(format!("{:e} x {:e}", 2.0 * a, 2.0 * b), 0.5, &direct(body, 0.5).samples(256))?;
    }
    Ok(())
}

/// Irradiance at the origin with normal +y from a polygon of radiance 1
/// (Lambert 1760): ½ Σ θ_i n·Γ_i, all corners above the horizon.
fn lambert(corners: [DVec3; 3]) -> f64 {
    let edge = |i: usize| {
        let (a, b) = (corners[i].normalize(), corners[(i + 1) % 3].normalize());
        let cross = a.cross(b);
        cross.length().atan2(a.dot(b)) * cross.normalize().y
    };
    (0.5 * (edge(0) + edge(1) + edge(2))).abs()
}

fn triangles(sheet: &mut Sheet) -> Result<()> {
    let mut random = Random(9);
    let wanted = if sheet.full() { 100 } else { 10 };
    let mut made = 0;
    while made < wanted {
        let mut corners = [(); 3].map(|()| {
            let v = random.vector() * 2.0;
            Vec3::new(v.x, v.y.abs() + 0.1, v.z)
        });
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        if normal.dot(corners[0]) > 0.0 {
            corners.swap(1, 2);
        }
        // One that is seen all but edge-on gives nothing that could be compared.
        let irradiance = lambert(corners.map(Vec3::as_dvec3));
        if irradiance < 0.02 {
            continue;
        }
        let mesh = Mesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
        let file = sheet.shop.mesh(&format!("triangle{made}"), &mesh)?;
        let body = format!(
            r#"{FLOOR}<shape type="ply"><string name="filename" value="{file}"/>{}</shape>"#,
            glow(1.0 / irradiance)
        );
        sheet.radiance(format!("triangle {made}"), 0.5 / PI, &direct(body, 0.05).samples(256))?;
        made += 1;
    }
    Ok(())
}

fn form_factors(sheet: &mut Sheet) -> Result<()> {
    // The receiver has albedo 1 and fills the film of an orthographic camera
    // (a disk: π/4 of it), the emitter radiance 1: the mean is the form factor.
    let pair = |shape: &str, place: &str| {
        format!(
            r#"<shape type="{shape}"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="-90"/>
            </transform>{}</shape><shape type="{shape}"><transform name="to_world"><scale value="0.5"/>{place}
            </transform>{}</shape>"#,
            diffuse(1.0),
            glow(1.0)
        )
    };
    let facing = r#"<rotate x="1" angle="90"/><translate y="1"/>"#;
    let beside = r#"<translate y="0.5" z="-0.5"/>"#;
    let view = ortho([0.0, 0.2, 0.0], [0.0; 3], 0.5);
    let cases = [
        ("squares that face each other", pair("rectangle", facing), 0.199_824_896),
        ("squares with a common edge", pair("rectangle", beside), 0.200_043_776),
    ];
    for (name, body, factor) in cases {
        let still = Still::new(body, [0.0; 3], [0.0; 3]).integrator(path(2)).seen_by(&view).samples(512);
        sheet.radiance(name, factor, &still)?;
    }
    // Unit disks at distance 1.
    let body = pair("disk", r#"<rotate x="1" angle="90"/><translate y="0.5"/>"#);
    let still = Still::new(body, [0.0; 3], [0.0; 3]).integrator(path(2)).seen_by(&view).samples(2048);
    sheet.radiance("unit disks at 1", 0.381_966_011 * PI / 4.0, &still)
}

/// A hollow sphere around the origin that reflects `albedo` inside.
fn hollow(radius: f64, albedo: f64, light: &str) -> String {
    format!(
        r#"<shape type="sphere"><float name="radius" value="{radius:e}"/><boolean name="flip_normals" value="true"/>
        {}{light}</shape>"#,
        twosided(albedo)
    )
}

fn integrating_sphere(sheet: &mut Sheet) -> Result<()> {
    for radius in [1e-4, 1.0, 1e4] {
        let light = format!(
            r#"{}<emitter type="point"><rgb name="intensity" value="{:e}"/></emitter>"#,
            hollow(radius, 0.5, ""),
            PI * radius * radius
        );
        let inside = [0.3 * radius, 0.1 * radius, 0.0];
        // Forty bounces without roulette leave nothing to chance.
        let still = Still::new(light, inside, [radius, radius, 0.5 * radius]).integrator(path_unended(41));
        let name = format!("r = {radius:e}");
        sheet.shop.offer(&name, &still, 1.0)?;
        let means = sheet.shop.means(&still.samples(4))?.values;
        sheet.within(name, 1.0, means[0], 2e-6);
    }
    Ok(())
}

fn glowing_cube(sheet: &mut Sheet) -> Result<()> {
    let cube = |albedo: f64| {
        format!(
            r#"<shape type="cube"><boolean name="flip_normals" value="true"/>{}{}</shape>"#,
            twosided(albedo),
            glow(1.0)
        )
    };
    for albedo in [0.5f64, 0.8, 0.9, 0.95, 0.98, 0.99] {
        let still = Still::new(cube(albedo), [0.1, 0.2, 0.3], [1.0, 0.4, -0.2]);
        let still = still.samples(if albedo < 0.97 { 512 } else { 128 });
        let margin = if albedo < 0.97 { 0.02 } else { 0.05 };
        sheet.radiance_to(format!("albedo {albedo}"), 1.0 / (1.0 - albedo), margin, &still)?;
    }
    for (albedo, depth) in [(0.5f64, 4), (0.8, 8), (0.98, 30)] {
        let sum = (1.0 - albedo.powi(depth)) / (1.0 - albedo);
        let still = Still::new(cube(albedo), [0.1, 0.2, 0.3], [1.0, 0.4, -0.2]).samples(256);
        let still = still.integrator(path(i64::from(depth)));
        sheet.radiance(format!("albedo {albedo}, depth {depth}"), sum, &still)?;
    }
    Ok(())
}

fn glowing_sphere(sheet: &mut Sheet) -> Result<()> {
    for (radius, albedo) in [(1e-4, 0.8), (1e-2, 0.8), (1.0, 0.5), (1.0, 0.98), (1e4, 0.8), (1e6, 0.8)] {
        let body = hollow(radius, albedo, &glow(1.0));
        let inside = [0.3 * radius, 0.1 * radius, 0.0];
        let still = Still::new(body, inside, [radius, radius, 0.5 * radius]).samples(256);
        let name = format!("r = {radius:e}, albedo {albedo}");
        sheet.radiance_to(name, 1.0 / (1.0 - albedo), 0.02, &still)?;
    }
    Ok(())
}

/// Power of Mitsuba's spot of intensity 1: full up to the angle b, then falling
/// linearly to the angle c.
fn spot_power(b: f64, c: f64) -> f64 {
    2.0 * PI * (1.0 - (c.sin() - b.sin()) / (c - b))
}

fn spot(sheet: &mut Sheet) -> Result<()> {
    // Away from the beam only light of two bounces and more arrives, and that
    // is the same everywhere: ρ² Φ / (1 − ρ) over π and the sphere's area.
    let albedo = 0.5;
    for (beam, cutoff) in [(20.0f64, 30.0f64), (1.0, 80.0), (5.0, 10.0)] {
        let power = spot_power(beam.to_radians(), cutoff.to_radians());
        let body = format!(
            r#"{}<emitter type="spot"><float name="beam_width" value="{beam}"/>
            <float name="cutoff_angle" value="{cutoff}"/><rgb name="intensity" value="{:e}"/>
            <transform name="to_world"><lookat origin="0,0,0" target="0,1,0" up="1,0,0"/></transform></emitter>"#,
            hollow(1.0, albedo, ""),
            4.0 * PI * PI * (1.0 - albedo) / (albedo * albedo * power)
        );
        let still = Still::new(body, [0.0, 0.1, 0.0], [0.0, -1.0, 0.1]).samples(4096);
        let margin = if beam == 5.0 { 0.06 } else { 0.02 };
        sheet.radiance_to(format!("spot of {beam} to {cutoff} degrees"), 1.0, margin, &still)?;
    }
    Ok(())
}

fn texel(sheet: &mut Sheet) -> Result<()> {
    let (width, height) = (64u32, 32u32);
    for (row, strength) in [(5u32, 1e6f32), (5, 1e12), (0, 1e6)] {
        let lit = row * width + 17;
        let value = |i: u32| if i == lit { strength } else { 1.0 };
        let file = sheet.shop.image("sky", [width, height], &|i| [value(i); 3])?;
        let (irradiance, towards) = tent(width, height, 17, row, f64::from(strength));
        // A floor that faces the texel.
        let [x, y, z] = towards.to_array();
        let body = format!(
            r#"<shape type="rectangle"><transform name="to_world"><lookat origin="0,0,0" target="{x},{y},{z}"
            up="0,0,1"/></transform>{}</shape>
            <emitter type="envmap"><string name="filename" value="{file}"/></emitter>"#,
            diffuse(1.0)
        );
        let from = 0.4 * towards + 0.3 * towards.any_orthonormal_vector();
        let still = Still::new(body, from.to_array(), [0.0; 3]).integrator(path(2)).samples(256);
        let name = format!("{strength:e} in row {row} of {width} x {height}");
        sheet.radiance(name, irradiance / PI, &still)?;
    }
    Ok(())
}

/// Irradiance of a plane that faces a texel of `strength` among ones, and the
/// texel's direction. Values are at the centres of texels, linear between.
fn tent(width: u32, height: u32, column: u32, row: u32, strength: f64) -> (f64, DVec3) {
    let direction = |u: f64, v: f64| {
        let (phi, theta) = (u * 2.0 * PI, v * PI);
        DVec3::new(phi.sin() * theta.sin(), theta.cos(), -phi.cos() * theta.sin())
    };
    let at = |c: f64, r: f64| direction((c + 0.5) / f64::from(width), r / f64::from(height - 1));
    let n = at(f64::from(column), f64::from(row));
    let steps = 600;
    let mut extra = 0.0;
    for j in 0..steps {
        for i in 0..steps {
            let offset = |k: i32| (f64::from(k) + 0.5) / f64::from(steps) * 2.0 - 1.0;
            let (s, t) = (offset(i), offset(j));
            let row = f64::from(row) + t;
            if row < 0.0 {
                continue;
            }
            let area = 2.0 * PI / f64::from(width) * PI / f64::from(height - 1)
                * (row / f64::from(height - 1) * PI).sin();
            let cos = n.dot(at(f64::from(column) + s, row)).max(0.0);
            extra += (1.0 - s.abs()) * (1.0 - t.abs()) * cos * area;
        }
    }
    (PI + (strength - 1.0) * extra * 4.0 / f64::from(steps * steps), n)
}
