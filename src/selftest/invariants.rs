//! C1 to C9: what may not change a picture.

use super::Row;
use super::sheet::{Same, Sheet, mean_and_error};
use super::stage::{Still, diffuse, glow, mean, options, path, path_unended, rgb, sky};
use crate::desc::{Mesh, Result};
use crate::film::Picture;
use crate::math::Vec3;
use crate::render::{RenderOptions, TileOrder};
use crate::sampling::Sequence;

pub(super) const ROWS: &[Row] = &[
    Row { id: "C1", what: "the scene times a power of two: the same bits", run: powers_of_two },
    Row { id: "C2", what: "the scene times a power of ten: the same picture", run: powers_of_ten },
    Row { id: "C3", what: "the scene moved, camera and all: the same picture", run: moved },
    Row { id: "C4", what: "light times a power of two: the same bits, times that", run: brightness },
    Row { id: "C5", what: "threads, tiles and crops: the same bits", run: order },
    Row { id: "C6", what: "axes exchanged and mirrored: the same mean", run: axes },
    Row { id: "C7", what: "light samples, bsdf samples, roulette, samplers: the same mean", run: strategies },
    Row { id: "C8", what: "meshes cut up and instances: the same picture", run: cut_up },
    Row { id: "C9", what: "what gives no light and is not seen changes nothing", run: nothing_added },
];

/// A room with a lamp, a point light, a ball, a glossy box and a glass ball.
#[derive(Clone, Copy)]
struct Room {
    /// Its unit.
    scale: f64,
    /// Where its origin is, in units of the world.
    at: [f64; 3],
    /// Factor on its light.
    light: f64,
    /// A transform of all of it.
    frame: &'static str,
    /// What mirrors also turns spheres inside out: they are to be turned back.
    mirrored: bool,
}

const ROOM: Room = Room { scale: 1.0, at: CENTRE, light: 1.0, frame: "", mirrored: false };

impl Room {
    /// The transform that makes a thing of `size` at a place of the room.
    fn place(&self, turn: &str, size: f64, place: [f64; 3]) -> String {
        let [x, y, z] = [0, 1, 2].map(|i| self.at[i] + place[i] * self.scale);
        let size = size * self.scale;
        format!(
            r#"<transform name="to_world">{turn}<scale value="{size:e}"/><translate x="{x:e}" y="{y:e}" z="{z:e}"/>{}
            </transform>"#,
            self.frame
        )
    }

    fn still(&self) -> Still {
        let wall = |turn: &str, place: [f64; 3], albedo: &str| {
            format!(
                r#"<shape type="rectangle">{}<bsdf type="diffuse"><rgb name="reflectance" value="{albedo}"/></bsdf>
                </shape>"#,
                self.place(turn, 1.0, place)
            )
        };
        let thing = |kind: &str, turn: &str, size: f64, place: [f64; 3], rest: &str| {
            format!(r#"<shape type="{kind}">{}{rest}</shape>"#, self.place(turn, size, place))
        };
        let [from_x, from_y, from_z] = [self.at[0], self.at[1], self.at[2] + 3.5 * self.scale];
        let [x, y, z] = self.at;
        let camera = format!(
            r#"<sensor type="perspective"><float name="fov" value="40"/><float name="near_clip" value="{:e}"/>
            <float name="far_clip" value="{:e}"/><transform name="to_world">
            <lookat origin="{from_x:e},{from_y:e},{from_z:e}" target="{x:e},{y:e},{z:e}" up="0,1,0"/>{}</transform>"#,
            1e-2 * self.scale,
            1e4 * self.scale,
            self.frame
        );
        let ball = |radius: f64, place: [f64; 3], bsdf: &str| {
            let flip = format!(r#"<boolean name="flip_normals" value="{}"/>{bsdf}"#, self.mirrored);
            thing("sphere", "", radius, place, &flip)
        };
        let intensity = 0.25 * self.light * self.scale * self.scale;
        let parts = [
            wall(r#"<rotate x="1" angle="-90"/>"#, [0.0, -1.0, 0.0], "0.7"),
            wall(r#"<rotate x="1" angle="90"/>"#, [0.0, 1.0, 0.0], "0.7"),
            wall(r#"<rotate y="1" angle="90"/>"#, [-1.0, 0.0, 0.0], "0.6,0.1,0.1"),
            wall(r#"<rotate y="1" angle="-90"/>"#, [1.0, 0.0, 0.0], "0.1,0.5,0.1"),
            wall("", [0.0, 0.0, -1.0], "0.7"),
            thing(
                "rectangle",
                r#"<rotate x="1" angle="90"/>"#,
                0.25,
                [0.0, 0.9375, 0.0],
                &glow(12.0 * self.light),
            ),
            format!(
                r#"<emitter type="point">{}<rgb name="intensity" value="{intensity:e}"/></emitter>"#,
                self.place("", 1.0, [0.75, 0.5, 0.5])
            ),
            ball(0.375, [-0.5, -0.625, -0.25], &diffuse(0.5)),
            ball(0.25, [0.0, -0.75, 0.5], r#"<bsdf type="dielectric"/>"#),
            thing(
                "cube",
                r#"<rotate y="1" angle="20"/>"#,
                0.3125,
                [0.5, -0.6875, -0.375],
                r#"<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>"#,
            ),
        ];
        Still::new(parts.concat(), CENTRE, CENTRE).view(0.0, 16).seen_by(&camera).integrator(path(8))
    }
}

/// [`ROOM`] in units of `scale`, at `at`, its light times `light`.
fn room(scale: f64, at: [f64; 3], light: f64) -> Still {
    Room { scale, at, light, ..ROOM }.still()
}

const CENTRE: [f64; 3] = [0.0; 3];
/// Samples per pixel of pictures whose noise is the same.
const SAMPLES: u64 = 16;

/// Values of `b` that are not those of `a` times `factor`, bit for bit.
fn differences(a: &[f32], b: &[f32], factor: f64) -> u64 {
    let differ = |(x, y): &(&f32, &f32)| ((f64::from(**x) * factor) as f32).to_bits() != y.to_bits();
    a.iter().zip(b).filter(differ).count() as u64
}

fn powers_of_two(sheet: &mut Sheet) -> Result<()> {
    let one = rgb(&sheet.shop.picture(&room(1.0, CENTRE, 1.0), SAMPLES)?);
    let all: Vec<i32> =
        if sheet.full() { (-40..=40).collect() } else { vec![-40, -20, -10, -1, 1, 10, 20, 40] };
    for k in all {
        let still = room(2f64.powi(k), CENTRE, 1.0);
        let scaled = rgb(&sheet.shop.picture(&still, SAMPLES)?);
        sheet.none(format!("2^{k}"), differences(&one, &scaled, 1.0), one.len() as u64);
    }
    Ok(())
}

/// Root of the mean square of the difference of 4 × 4 blocks, relative to the
/// mean.
fn block_rmse(a: &[f32], b: &[f32], size: usize) -> f64 {
    let pixels = size * size;
    let mut sum = 0.0;
    let mut blocks = 0.0;
    let mean = a.iter().map(|v| f64::from(*v)).sum::<f64>() / a.len() as f64;
    for by in (0..size).step_by(4) {
        for bx in (0..size).step_by(4) {
            for channel in 0..3 {
                let at = |values: &[f32]| -> f64 {
                    let each = (0..16).map(|i| (by + i / 4) * size + bx + i % 4 + channel * pixels);
                    each.map(|i| f64::from(values[i])).sum::<f64>() / 16.0
                };
                sum += ((at(a) - at(b)) / mean).powi(2);
                blocks += 1.0;
            }
        }
    }
    (sum / blocks).sqrt()
}

/// A picture is the same but for rounding, which may send a few paths another
/// way: mean within 1e-4, blocks within a tenth of the noise of another seed.
fn same_picture(sheet: &mut Sheet, name: &str, one: &Picture, noise: f64, other: &Picture) {
    sheet.within(format!("{name}: mean"), mean(one), mean(other), 1e-4);
    let rmse = block_rmse(&rgb(one), &rgb(other), 16);
    sheet.within(format!("{name}: blocks / noise"), 0.0, rmse / noise, 0.1);
}

/// The room, and the block error that another seed makes.
fn unmoved(sheet: &mut Sheet) -> Result<(Picture, f64)> {
    let ready = sheet.shop.build(&room(1.0, CENTRE, 1.0).xml())?;
    let seed = sheet.shop.seed;
    let picture = |seed| Ok(ready.render(&options(64, seed))?.film.resolve());
    let (one, other): (Picture, Picture) = (picture(seed)?, picture(seed + 1)?);
    let noise = block_rmse(&rgb(&one), &rgb(&other), 16);
    Ok((one, noise))
}

fn powers_of_ten(sheet: &mut Sheet) -> Result<()> {
    let (one, noise) = unmoved(sheet)?;
    for k in [-6, -3, -1, 1, 3, 6] {
        let still = room(10f64.powi(k), CENTRE, 1.0);
        let scaled = sheet.shop.picture(&still, 64)?;
        same_picture(sheet, &format!("1e{k}"), &one, noise, &scaled);
        sheet.shop.offer(&format!("1e{k}: mean"), &still, mean(&one))?;
    }
    Ok(())
}

fn moved(sheet: &mut Sheet) -> Result<()> {
    let (one, noise) = unmoved(sheet)?;
    for (name, distance) in [
        ("2^7", 2f64.powi(7)),
        ("2^12", 2f64.powi(12)),
        ("2^15", 2f64.powi(15)),
        ("2^18", 2f64.powi(18)),
        ("1e7", 1e7),
        ("1e12", 1e12),
    ] {
        let still = room(1.0, [distance; 3], 1.0);
        let moved = sheet.shop.picture(&still, 64)?;
        same_picture(sheet, name, &one, noise, &moved);
        sheet.shop.offer(&format!("{name}: mean"), &still, mean(&one))?;
    }
    Ok(())
}

fn brightness(sheet: &mut Sheet) -> Result<()> {
    let one = rgb(&sheet.shop.picture(&room(1.0, CENTRE, 1.0), SAMPLES)?);
    for k in [-60, -30, -1, 1, 30, 60] {
        let factor = 2f64.powi(k);
        let other = rgb(&sheet.shop.picture(&room(1.0, CENTRE, factor), SAMPLES)?);
        sheet.none(format!("2^{k}"), differences(&one, &other, factor), one.len() as u64);
    }
    Ok(())
}

fn order(sheet: &mut Sheet) -> Result<()> {
    let still = room(1.0, CENTRE, 1.0).view(0.0, 48);
    let ready = sheet.shop.build(&still.xml())?;
    let seed = sheet.shop.seed;
    let picture = |threads, order| {
        let options = RenderOptions { threads, order, ..options(4, seed) };
        Ok(rgb(&ready.render(&options)?.film.resolve()))
    };
    let one = picture(1, TileOrder::CentreOut)?;
    for threads in [2, 7] {
        let other = picture(threads, TileOrder::CentreOut)?;
        sheet.none(format!("{threads} threads"), differences(&one, &other, 1.0), one.len() as u64);
    }
    let shuffled = picture(3, TileOrder::Shuffled(5))?;
    sheet.none("tiles shuffled", differences(&one, &shuffled, 1.0), one.len() as u64);
    // A crop window is that part of the picture.
    let crop = r#"<integer name="crop_offset_x" value="11"/><integer name="crop_offset_y" value="19"/>
        <integer name="crop_width" value="20"/><integer name="crop_height" value="9"/><rfilter"#;
    let cropped = sheet.shop.build(&still.xml().replace("<rfilter", crop))?;
    let part = rgb(&cropped.render(&options(4, seed))?.film.resolve());
    let mut differ = 0;
    for channel in 0..3 {
        for i in 0..20 * 9 {
            let whole = one[channel * 48 * 48 + (19 + i / 20) * 48 + 11 + i % 20];
            differ += u64::from(whole.to_bits() != part[channel * 180 + i].to_bits());
        }
    }
    sheet.none("crop window", differ, part.len() as u64);
    Ok(())
}

fn axes(sheet: &mut Sheet) -> Result<()> {
    let still = |frame, mirrored| Room { frame, mirrored, ..ROOM }.still().view(0.0, 4).samples(1024);
    let one = mean_and_error(&sheet.shop.means(&still("", false))?.values);
    for (name, mirrored, frame) in [
        ("x to y to z", false, r#"<matrix value="0 0 1 0 1 0 0 0 0 1 0 0 0 0 0 1"/>"#),
        ("mirrored", true, r#"<matrix value="-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/>"#),
    ] {
        let other = mean_and_error(&sheet.shop.means(&still(frame, mirrored))?.values);
        sheet.against(name, one, other, Same::to(0.04));
    }
    Ok(())
}

/// A floor under a ball of light and a grey sky.
fn lit_floor(integrator: String) -> Still {
    let body = format!(
        r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform>{}</shape>
        <shape type="sphere"><point name="center" x="-0.6" y="0.6" z="0.2"/><float name="radius" value="0.3"/>{}
        </shape>{}"#,
        diffuse(0.5),
        glow(4.0),
        sky(0.7)
    );
    Still::new(body, [0.3, 0.5, 0.0], [0.0; 3]).integrator(integrator).samples(512)
}

fn strategies(sheet: &mut Sheet) -> Result<()> {
    let direct = |light: u32, bsdf: u32| {
        format!(
            r#"<integrator type="direct"><integer name="emitter_samples" value="{light}"/>
            <integer name="bsdf_samples" value="{bsdf}"/></integrator>"#
        )
    };
    let both = mean_and_error(&sheet.shop.means(&lit_floor(direct(1, 1)))?.values);
    for (name, light, bsdf) in [("lights alone", 1, 0), ("bsdfs alone", 0, 1), ("three and two", 3, 2)] {
        let other = mean_and_error(&sheet.shop.means(&lit_floor(direct(light, bsdf)))?.values);
        sheet.against(format!("{name}, to one of each"), both, other, Same::to(0.01));
    }
    for sequence in [Sequence::Padded, Sequence::Lattice, Sequence::Independent] {
        let other = sheet.shop.means_with(&lit_floor(direct(1, 1)), sequence)?;
        let other = mean_and_error(&other.values);
        sheet.against(format!("sampler {}, to sobol", sequence.name()), both, other, Same::to(0.01));
    }
    // Roulette: the room with all bounces.
    let bounces = |integrator| room(1.0, CENTRE, 1.0).view(0.0, 4).samples(1024).integrator(integrator);
    let with = mean_and_error(&sheet.shop.means(&bounces(path(-1)))?.values);
    let without = mean_and_error(&sheet.shop.means(&bounces(path_unended(60)))?.values);
    sheet.against("with roulette, to without", without, with, Same::to(0.04));
    Ok(())
}

fn cut_up(sheet: &mut Sheet) -> Result<()> {
    let ball = super::meshes::sphere(8, 16, 0.5, Vec3::ZERO, false);
    let scene = |shapes: &str| {
        let floor = format!(
            r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/>
            <translate y="-0.5"/></transform>{}</shape>"#,
            diffuse(0.5)
        );
        let body = format!("{floor}{shapes}{}", sky(1.0));
        Still::new(body, [0.0, 1.0, 3.0], [0.0; 3]).view(40.0, 16)
    };
    let file = |name: &str| {
        format!(
            r#"<shape type="ply"><string name="filename" value="{name}"/>
            <boolean name="face_normals" value="true"/><bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf></shape>"#
        )
    };
    let whole = file(&sheet.shop.mesh("ball", &ball)?);
    let one = sheet.shop.picture(&scene(&whole), SAMPLES)?;
    let mut pieces = String::new();
    for (i, t) in ball.triangles.iter().enumerate() {
        let positions = t.map(|v| ball.positions[v as usize]).to_vec();
        let piece = Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() };
        pieces += &file(&sheet.shop.mesh(&format!("piece{i}"), &piece)?);
    }
    let cut = sheet.shop.picture(&scene(&pieces), SAMPLES)?;
    let count = rgb(&one).len() as u64;
    sheet.none("a mesh per triangle", differences(&rgb(&one), &rgb(&cut), 1.0), count);
    let placed = |place: &str| {
        format!(
            r#"<shape type="shapegroup" id="g">{whole}</shape><shape type="instance"><ref id="g"/>
            <transform name="to_world">{place}</transform></shape>"#
        )
    };
    // Where nothing is moved by more than rounding, neither is the picture.
    let instance = sheet.shop.picture(&scene(&placed("")), SAMPLES)?;
    sheet.within("an instance: mean", mean(&one), mean(&instance), 1e-4);
    let turn = r#"<rotate x="1" y="2" z="3" angle="40"/><scale x="1.5" y="0.7" z="1"/>"#;
    let baked = whole.replace("<bsdf", &format!(r#"<transform name="to_world">{turn}</transform><bsdf"#));
    let (a, b) = (sheet.shop.picture(&scene(&baked), 64)?, sheet.shop.picture(&scene(&placed(turn)), 64)?);
    sheet.within("an instance turned and stretched: mean", mean(&a), mean(&b), 1e-4);
    Ok(())
}

fn nothing_added(sheet: &mut Sheet) -> Result<()> {
    let base = room(1.0, CENTRE, 1.0);
    let one = rgb(&sheet.shop.picture(&base, SAMPLES)?);
    let mut dark = String::new();
    for i in 0..999 {
        dark += &format!(
            r#"<emitter type="point"><point name="position" x="{}" y="0" z="0"/>
            <rgb name="intensity" value="0"/></emitter>"#,
            f64::from(i) * 1e-3
        );
    }
    let black_lamp = format!(
        r#"<shape type="rectangle"><transform name="to_world"><translate z="-40"/></transform>{}</shape>"#,
        glow(0.0)
    );
    let collapsed = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::X],
        triangles: vec![[0, 1, 2], [0, 0, 0]],
        ..Mesh::default()
    };
    let empty = format!(
        r#"<shape type="ply"><string name="filename" value="{}"/></shape>"#,
        sheet.shop.mesh("collapsed", &collapsed)?
    );
    for (name, added) in [
        ("999 lights without power", dark),
        ("a black sky", sky(0.0)),
        ("a lamp without power", black_lamp),
        ("a mesh without area", empty),
    ] {
        let still = Still { body: format!("{}{added}", base.body), ..base.clone() };
        let other = rgb(&sheet.shop.picture(&still, SAMPLES)?);
        sheet.none(name, differences(&one, &other, 1.0), one.len() as u64);
    }
    Ok(())
}
