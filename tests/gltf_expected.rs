//! What must be seen in the glTF models that probe one feature each: the table
//! `docs/gltf-models.md`, in numbers. The models of `shared/scenes/gltf` are
//! read where they are; without that folder there is nothing to do.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]
#![allow(clippy::print_stdout, reason = "says what it skipped and measured")]

#[path = "common/render.rs"]
mod render;
#[path = "common/shared_models.rs"]
mod shared_models;

use etendue::desc::{Category, Object, Param, Pos, SceneDesc, Value};
use etendue::load::{LoadOptions, load};
use etendue::math::{DMat4, DVec3, Transform, Vec3};
use render::{Ready, rgb};
use shared_models::{boxes, buffers, model, models, world};

/// A picture seen from +z in parallel, `half` to each side of the middle.
struct Front {
    pixels: Vec<f32>,
    size: usize,
    middle: [f64; 2],
    half: f64,
}

fn add(desc: &mut SceneDesc, category: Category, plugin: &str, params: Vec<(&str, Value)>) -> u32 {
    let pos = Pos::default();
    let params = params.into_iter().map(|(name, value)| Param { name: name.into(), value, pos }).collect();
    desc.objects.push(Object { category, plugin: plugin.into(), id: String::new(), pos, params });
    desc.objects.len() as u32 - 1
}

fn show(desc: &mut SceneDesc, id: u32) {
    let root = desc.root as usize;
    let param = Param { name: String::new(), value: Value::Object(id), pos: Pos::default() };
    desc.objects[root].params.push(param);
}

impl Front {
    fn of(mut desc: SceneDesc, middle: [f64; 2], half: f64, size: usize, samples: u64) -> Front {
        let pose = DMat4::from_translation(DVec3::new(middle[0], middle[1], 50.0))
            * DMat4::from_scale(DVec3::new(-half, half, -1.0));
        let pose = Value::Transform(Transform::from_matrix(pose).unwrap());
        let filter = add(&mut desc, Category::Rfilter, "box", vec![]);
        let side = || Value::Int(size as i64);
        let film = vec![("width", side()), ("height", side()), ("", Value::Object(filter))];
        let film = add(&mut desc, Category::Film, "hdrfilm", film);
        let params = vec![("to_world", pose), ("near_clip", Value::Float(0.01)), ("", Value::Object(film))];
        let others: Vec<u32> = (0..desc.objects.len() as u32)
            .filter(|id| desc.object(*id).category == Category::Sensor)
            .collect();
        let root = desc.root as usize;
        desc.objects[root].params.retain(|p| !matches!(p.value, Value::Object(id) if others.contains(&id)));
        let sensor = add(&mut desc, Category::Sensor, "orthographic", params);
        show(&mut desc, sensor);
        let pixels = rgb(&Ready::build(&desc, None, None).picture(samples, 1));
        Front { pixels, size, middle, half }
    }

    fn pixel(&self, column: usize, row: usize) -> Vec3 {
        let at = 3 * (row.min(self.size - 1) * self.size + column.min(self.size - 1));
        Vec3::from_slice(&self.pixels[at..at + 3])
    }

    /// The mean of nine pixels around a place of the world.
    fn at(&self, x: f64, y: f64) -> Vec3 {
        let place = |c: f64, middle: f64, sign: f64| {
            ((0.5 + 0.5 * sign * (c - middle) / self.half) * self.size as f64) as usize
        };
        let (column, row) = (place(x, self.middle[0], 1.0), place(y, self.middle[1], -1.0));
        let near = (0..9).map(|k| self.pixel((column + k % 3).max(1) - 1, (row + k / 3).max(1) - 1));
        near.sum::<Vec3>() / 9.0
    }

    /// Where the middle of a pixel is.
    fn place(&self, column: usize, row: usize) -> [f64; 2] {
        let c = |k: usize| (2.0 * (k as f64 + 0.5) / self.size as f64 - 1.0) * self.half;
        [self.middle[0] + c(column), self.middle[1] - c(row)]
    }
}

fn read(part: &str) -> Option<SceneDesc> {
    read_with(part, LoadOptions::default())
}

fn read_with(part: &str, options: LoadOptions) -> Option<SceneDesc> {
    Some(load(&model(part)?, &options).unwrap_or_else(|e| panic!("{e}")))
}

/// The picture that the file's own camera, or the one made up, takes.
fn picture(desc: &SceneDesc, size: [u32; 2], samples: u64) -> Vec<f32> {
    let build = etendue::scene::BuildOptions { size: Some(size), ..Default::default() };
    let scene = etendue::scene::Scene::build(desc, &build).unwrap_or_else(|e| panic!("{e}"));
    let integrator = etendue::integrator::Integrator::from_desc(desc, &Default::default()).unwrap();
    rgb(&Ready { scene, integrator }.picture(samples, 1))
}

fn difference(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32
}

/// Each tile shows the letters of its offset on their colour; each arrow points
/// at the mark for "correct" and not at those for "not supported" and "error".
#[test]
fn texture_transforms() {
    let Some(desc) = read("TextureTransformTest.gltf") else { return };
    let front = Front::of(desc, [0.0, 0.0], 1.75, 700, 4);
    // Corners of the tiles: green, blue, cyan.
    for (x, expected) in [(-1.1, [0, 1, 0]), (0.0, [0, 0, 1]), (1.1, [0, 1, 1])] {
        for corner in [[-0.42, -0.42], [0.42, -0.42], [-0.42, 0.42], [0.42, 0.42]] {
            let c = front.at(x + corner[0], 0.55 + corner[1]);
            for (channel, on) in expected.into_iter().enumerate() {
                let value = c[channel];
                assert!(if on == 1 { value > 0.4 } else { value < 0.15 }, "tile at {x}, {corner:?}: {c}");
            }
        }
    }
    // The markers' nodes, as the file places them in their tiles.
    let marks = [
        ("Rotation", -1.1, [-0.079, -0.516], vec![[0.278, -0.278], [0.516, 0.079]]),
        ("Scale", 0.0, [0.0185, -0.0185], vec![[0.278, -0.278]]),
        ("All", 1.1, [-0.07, -0.25], vec![]),
    ];
    for (name, x, correct, wrong) in marks {
        let distance = |mark: [f64; 2]| {
            let mut nearest = f64::INFINITY;
            for row in 0..front.size {
                for column in 0..front.size {
                    let [px, py] = front.place(column, row);
                    let inside = (px - x).abs() < 0.5 && (py + 0.55).abs() < 0.5;
                    if inside && front.pixel(column, row).max_element() < 0.1 {
                        nearest = nearest.min((px - x - mark[0]).hypot(py + 0.55 - mark[1]));
                    }
                }
            }
            nearest
        };
        let right = distance(correct);
        println!("{name}: the arrow ends {right:.3} from the middle of `correct`");
        // The mark, which lies over the tip, is 0.15 wide or less.
        assert!(right < 0.15, "{name}: {right}");
        for mark in wrong {
            assert!(distance(mark) > right + 0.08, "{name}: {} from {mark:?}", distance(mark));
        }
    }
}

/// Stripes are there from the cutoff of the label on, and elsewhere the marble
/// behind is seen; blended ones fade.
#[test]
fn alpha_blend_modes() {
    let Some(desc) = read("AlphaBlendModeTest.glb") else { return };
    let front = Front::of(desc, [0.0, 1.0], 4.5, 900, 16);
    // Alpha falls from 1 to 0 upwards, along the labels.
    let saturation = |x: f64, y: f64| {
        let c = front.at(x, y);
        (c.max_element() - c.min_element()) / c.max_element()
    };
    let share = |x: f64, low: f64, high: f64| {
        let points = (0..40).flat_map(|i| (0..10).map(move |j| (i, j)));
        let values = points.map(|(i, j)| {
            saturation(x + 0.05 + 0.03 * f64::from(j), low + (high - low) * f64::from(i) / 39.0)
        });
        values.filter(|s| *s > 0.45).count() as f64 / 400.0
    };
    // y at which the alpha is 0.75, 0.5 and 0.25.
    let [three, half, quarter] = [0.67, 1.06, 1.46];
    for (x, cut) in [(0.0, quarter), (1.5, half), (3.0, three)] {
        let (below, above) = (share(x, 0.25, cut - 0.08), share(x, cut + 0.08, 1.8));
        println!("cut at y = {cut}: {below:.3} striped below, {above:.3} above");
        // The edges between stripes are grey.
        assert!(below > 0.8 && above < 0.05, "x = {x}: {below} below, {above} above");
    }
    assert!(share(-3.0, 0.25, 1.8) > 0.8, "opaque: {}", share(-3.0, 0.25, 1.8));
    let mean = |low: f64, high: f64| {
        (0..200)
            .map(|k| {
                saturation(-1.45 + 0.03 * f64::from(k % 10), low + (high - low) * f64::from(k / 10) / 19.0)
            })
            .sum::<f32>()
            / 200.0
    };
    let fading = [mean(0.25, 0.4), mean(0.65, 0.8), mean(1.0, 1.15), mean(1.4, 1.55), mean(1.7, 1.8)];
    println!("blended, from below: saturation {fading:?}");
    assert!(fading.windows(2).all(|w| w[0] > w[1] + 0.02), "{fading:?}");
}

/// In each row the coated sample shows its base below what the sample of the
/// coating alone reflects.
#[test]
fn clear_coats() {
    let Some(mut desc) = read("ClearCoatTest.gltf") else { return };
    // Its labels glow: it is not given any light.
    let constant = vec![("radiance", Value::Rgb([1.0; 3]))];
    let constant = add(&mut desc, Category::Emitter, "constant", constant);
    show(&mut desc, constant);
    let white = Front::of(desc, [0.0, 0.0], 6.5, 390, 64);
    // Flat parts of the tiles, head on in white: 0.04 of the coat, and the base
    // through it. Of the coating alone: black behind the coat.
    for (row, y) in [("simple", 5.25), ("base normals", -1.05)] {
        for corner in [[-0.75, 0.75], [0.75, -0.75]] {
            let [base, coated, coat] =
                [-2.1, 0.0, 2.1].map(|x| white.at(x + corner[0], y + corner[1]).max_element());
            println!("{row} {corner:?}: base {base}, coated {coated}, coat {coat}");
            assert!((0.035..0.045).contains(&coat), "{row} {corner:?}: coat {coat}");
            // What reaches the base and comes back is less by what the coat
            // reflects on both ways, of diffuse light a tenth.
            let (least, most) = (coat + 0.8 * base, coat + base);
            assert!((least..most).contains(&coated), "{row} {corner:?}: {coated}, not {least} to {most}");
        }
    }
    // Partly coated, by the red of the texture at u = 0.75 + x / 4: 0 from 0.78 to
    // 0.84, and 1 from 0.92 on.
    let more = |columns: [f64; 3]| {
        let places = columns.into_iter().flat_map(|x| [-0.9, -0.85, -0.8].map(|y| (x, 3.15 + y)));
        let value = |x: f64, y: f64| white.at(x, y).max_element();
        places.map(|(x, y)| value(x, y) - value(x - 2.1, y)).sum::<f32>() / 9.0
    };
    let (bare, covered) = (more([0.18, 0.22, 0.26]), more([0.75, 0.8, 0.85]));
    println!("partly: bare {bare} more than the base, covered {covered}");
    assert!(bare.abs() < 0.005 && covered > 0.015, "{bare} {covered}");
    // In the sun the highlights of the coating alone are those of the coated one.
    // (Those on ribs are too small for a few samples.)
    let options = LoadOptions { sun: Some([40.0, 20.0]), ..LoadOptions::default() };
    let sunny = Front::of(read_with("ClearCoatTest.gltf", options).unwrap(), [0.0, 0.0], 6.5, 390, 64);
    let rows = [("simple", 5.25), ("roughness", 1.05)];
    for (row, y) in rows {
        let (mut sums, mut brightest) = ([0.0f64; 5], [0.0; 3]);
        for k in 0..80 * 80 {
            let place = |i: i32| f64::from(i) * 0.0225 - 0.9;
            let value =
                |column: f64| f64::from(sunny.at(column + place(k % 80), y + place(k / 80)).z).min(1.0);
            let (base, coated, coat) = (value(-2.1), value(0.0), value(2.1));
            let more = coated - base;
            for (sum, v) in sums.iter_mut().zip([coat, more, coat * coat, more * more, coat * more]) {
                *sum += v / 6400.0;
            }
            if coat > brightest[2] {
                brightest = [base, coated, coat];
            }
        }
        let [a, b, aa, bb, ab] = sums;
        let correlation = (ab - a * b) / ((aa - a * a) * (bb - b * b)).sqrt();
        println!("{row}: correlation {correlation:.3}; base, coated, coat at the highlight {brightest:.3?}");
        let [base, coated, coat] = brightest;
        // A few samples find so small a highlight: no more than its presence counts.
        assert!(coat > 0.1 && coated - base > 0.25 * coat, "{row}: {brightest:?}");
        assert!(correlation > 0.5, "{row}: {correlation}");
    }
}

/// The factors of two columns whose sum is nearest to `target`, and the share of its
/// variance that is left.
fn nearest_sum(columns: [&[f64]; 2], target: &[f64]) -> ([f64; 2], f64) {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let [[aa, ab], [_, bb]] = columns.map(|c| columns.map(|d| product(c, d)));
    let [at, bt] = columns.map(|c| product(c, target));
    let det = aa * bb - ab * ab;
    let found = [(at * bb - bt * ab) / det, (bt * aa - at * ab) / det];
    let mean = target.iter().sum::<f64>() / target.len() as f64;
    let sums = columns[0].iter().zip(columns[1]).map(|(a, b)| found[0] * a + found[1] * b);
    let left: f64 = sums.zip(target).map(|(sum, t)| (t - sum).powi(2)).sum();
    (found, left / target.iter().map(|t| (t - mean).powi(2)).sum::<f64>())
}

/// The rows with normal maps, under three lamps far away. Each coated sample is a base,
/// less what the coat takes on both ways, and a coating: of the model's two bases and
/// three coatings only those with the normals that its row says. A ribbed base below a
/// smooth coat, ribs in both, a smooth base below a crumpled coat.
#[test]
fn normals_of_base_and_coat_are_their_own() {
    let Some(mut desc) = read("ClearCoatTest.gltf") else { return };
    for direction in [[0.6, 0.1, 0.8], [-0.45, 0.5, 0.74], [-0.1, -0.65, 0.75]] {
        let [x, y, z] = direction.map(|c: f64| 1000.0 * c);
        let radiance = vec![("radiance", Value::Rgb([1.0; 3]))];
        let glow = add(&mut desc, Category::Emitter, "area", radiance);
        let place = Transform::from_matrix(DMat4::from_translation(DVec3::new(x, y, z))).unwrap();
        let lamp = vec![
            ("radius", Value::Float(250.0)),
            ("to_world", Value::Transform(place)),
            ("", Value::Object(glow)),
        ];
        let lamp = add(&mut desc, Category::Shape, "sphere", lamp);
        show(&mut desc, lamp);
    }
    let front = Front::of(desc, [0.0, 0.0], 6.5, 260, 64);
    let sample = |column: f64, row: f64| -> Vec<f64> {
        let place = |i: i32| f64::from(i) * 0.0225 - 0.9;
        (0..80 * 80)
            .flat_map(|k| front.at(column + place(k % 80), row + place(k / 80)).to_array())
            .map(f64::from)
            .collect()
    };
    let (left, middle, right) = (-2.1, 0.0, 2.1);
    let (ribbed, shared, crumpled) = (-1.05, -3.15, -5.25);
    let bases = [("smooth", sample(left, crumpled)), ("ribbed", sample(left, ribbed))];
    let coats = [("smooth", ribbed), ("ribbed", shared), ("crumpled", crumpled)]
        .map(|(name, row)| (name, sample(right, row)));
    for (row, wanted) in
        [(ribbed, ("ribbed", "smooth")), (shared, ("ribbed", "ribbed")), (crumpled, ("smooth", "crumpled"))]
    {
        let coated = sample(middle, row);
        let mut fitting = Vec::new();
        for (base, below) in &bases {
            for (coat, above) in &coats {
                let ([a, b], left) = nearest_sum([below, above], &coated);
                println!("{a:.3} {base} base + {b:.3} {coat} coat: {:.1} % left", 100.0 * left);
                // A tenth of diffuse light is taken by the coat, and more of it towards the rim.
                if (0.8..1.0).contains(&a) && (0.9..1.15).contains(&b) && left < 0.1 {
                    fitting.push((*base, *coat));
                }
            }
        }
        assert_eq!(fitting, [wanted], "the row at {row}");
    }
}

/// Positions at every key of every animation, and as stored: base plus weights
/// times offsets, read by the `gltf` crate.
#[test]
fn morphs_at_all_keys() {
    let mut compared = 0;
    for path in models() {
        let Ok(file) = gltf::Gltf::open(&path) else { continue };
        let morphing: Vec<_> = file
            .nodes()
            .filter(|n| n.mesh().is_some_and(|m| m.primitives().any(|p| p.morph_targets().len() > 0)))
            .collect();
        let [node] = morphing.as_slice() else { continue };
        let Some(buffers) = buffers(&path, &file) else { continue };
        let of = |b: gltf::Buffer| buffers.get(b.index()).map(Vec::as_slice);
        let mesh = node.mesh().unwrap();
        // (animation, frame, weights)
        let mut poses: Vec<(Option<usize>, Option<f64>, Vec<f32>)> =
            vec![(None, None, mesh.weights().unwrap_or(&[]).to_vec())];
        for animation in file.animations() {
            for channel in animation.channels().filter(|c| c.target().node().index() == node.index()) {
                let reader = channel.reader(&of);
                let Some(gltf::animation::util::ReadOutputs::MorphTargetWeights(weights)) =
                    reader.read_outputs()
                else {
                    continue;
                };
                let weights: Vec<f32> = weights.into_f32().collect();
                let times: Vec<f32> = reader.read_inputs().unwrap().collect();
                assert_ne!(channel.sampler().interpolation(), gltf::animation::Interpolation::CubicSpline);
                let count = weights.len() / times.len();
                for (time, weights) in times.iter().zip(weights.chunks(count)) {
                    poses.push((Some(animation.index()), Some(f64::from(*time) * 24.0), weights.to_vec()));
                }
            }
        }
        for (animation, frame, weights) in poses {
            let options =
                LoadOptions { animation: animation.map(|a| a.to_string()), frame, ..LoadOptions::default() };
            let desc = load(&path, &options).unwrap();
            for (primitive, ours) in mesh.primitives().zip(&desc.meshes) {
                let reader = primitive.reader(&of);
                let mut expected: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from).collect();
                for ((offsets, ..), weight) in reader.read_morph_targets().zip(&weights) {
                    for (p, offset) in expected.iter_mut().zip(offsets.unwrap()) {
                        *p += Vec3::from(offset) * *weight;
                    }
                }
                assert_eq!(ours.positions.len(), expected.len(), "{}", path.display());
                let off =
                    ours.positions.iter().zip(&expected).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
                assert!(off < 1e-4, "{} {animation:?} {frame:?}: off by {off}", path.display());
            }
            compared += 1;
        }
    }
    println!("{compared} poses compared");
    assert!(compared == 0 || compared > 100, "{compared}");
}

/// What stands above the floor of the stress test when all targets are at their
/// strongest: eight blocks, each as high as its neighbours.
#[test]
fn all_targets_at_once() {
    let Some(path) = model("MorphStressTest.gltf") else { return };
    let raised = |frame: f64| {
        let options =
            LoadOptions { animation: Some("Pulse".into()), frame: Some(frame), ..LoadOptions::default() };
        let desc = load(&path, &options).unwrap();
        let blocks = &desc.meshes[1].positions;
        // Blocks from the left: eight of them over the width of all.
        let (low, high) =
            blocks.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), p| (a.min(p.x), b.max(p.x)));
        let mut tops = [f32::NEG_INFINITY; 8];
        for p in blocks {
            let k = (((p.x - low) / (high - low) * 8.0) as usize).min(7);
            tops[k] = tops[k].max(p.y);
        }
        tops
    };
    let rest = raised(0.0);
    let mut best = 0.0f32;
    for frame in 0..200 {
        let tops = raised(f64::from(frame));
        let moved: Vec<f32> = tops.iter().zip(rest).map(|(a, b)| a - b).collect();
        best = best.max(moved.iter().copied().fold(f32::INFINITY, f32::min));
    }
    println!("the least block is raised by {best}");
    assert!(best > 0.1, "not all blocks move at once: {best}");
}

/// The unit square, tilted by 45°, before both cameras.
#[test]
fn both_cameras() {
    for (camera, expected) in [
        // Orthographic: 1 × cos 45° of a window of 2 × 2.
        ("1", 0.5f64.sqrt() / 4.0),
        // Perspective: a trapezium whose far edge is sin 45° further away.
        ("0", {
            let scale = |depth: f64| 1.0 / (depth * 0.35f64.tan());
            let (near, far) = (scale(3.0), scale(3.0 + 0.5f64.sqrt()));
            let heights = 0.5 * near - (0.5 - 0.5f64.sqrt()) * far;
            0.25 * 0.5 * (near + far) * heights
        }),
    ] {
        let sun = Some([45.0, 0.0]);
        let options = LoadOptions { camera: Some(camera.into()), sun, ..LoadOptions::default() };
        let Some(desc) = read_with("cameras/Cameras.gltf", options) else { return };
        let pixels = picture(&desc, [200, 200], 16);
        // Half way from the sky to the square.
        let limit = 0.5 * (pixels[0] + pixels[3 * (110 * 200 + 100)]);
        let covered = pixels.chunks(3).filter(|c| c[0] > limit).count() as f64 / 40_000.0;
        println!("camera {camera}: {covered:.4} covered, expected {expected:.4}");
        assert!((covered / expected - 1.0).abs() < 0.03, "camera {camera}: {covered}, not {expected}");
    }
}

/// Files that are one thing stored in several ways look the same.
#[test]
fn one_model_in_several_ways() {
    let groups: &[(&[&str], f32)] = &[
        (&["BoxTextured-glTF-Binary/BoxTextured.glb", "BoxTextured-glTF-Embedded/BoxTextured.gltf"], 1e-3),
        // The picture in another resolution.
        (&["BoxTextured-glTF-Binary/BoxTextured.glb", "trimesh/BoxTextured.glb"], 0.03),
        (&["BoxTextured-glTF/BoxTextured.gltf", "wrongTypes/badString.gltf"], 1e-3),
        (&["2CylinderEngine-glTF-Binary/2CylinderEngine.glb", "draco/2CylinderEngine.gltf"], 0.02),
        (
            &[
                "PrimitiveMode_04.gltf",
                "PrimitiveMode_05.gltf",
                "PrimitiveMode_06.gltf",
                "PrimitiveMode_11.gltf",
                "PrimitiveMode_12.gltf",
                "PrimitiveMode_13.gltf",
                "PrimitiveMode_14.gltf",
                "PrimitiveMode_15.gltf",
            ],
            1e-3,
        ),
    ];
    for (files, allowed) in groups {
        let pictures: Vec<_> =
            files.iter().filter_map(|f| Some((f, picture(&read(f)?, [96, 72], 16)))).collect();
        let Some((_, first)) = pictures.first() else { return };
        assert_eq!(pictures.len(), files.len());
        let dark = first.chunks(3).filter(|c| c.iter().any(|v| *v < 0.95)).count();
        assert!(dark > 500, "{}: nothing is seen", files[0]);
        for (file, other) in &pictures[1..] {
            let off = difference(first, other);
            println!("{file}: off by {off}");
            assert!(off < *allowed, "{file}: {off}");
        }
    }
    // Points and lines have no surface: only the surroundings, and a warning.
    for k in [0, 1, 2, 3, 7, 8, 9, 10] {
        let desc = read(&format!("PrimitiveMode_{k:02}.gltf")).unwrap();
        assert!(desc.warnings.iter().any(|w| w.contains("have no surface")), "{k}");
        assert!(picture(&desc, [16, 12], 1).iter().all(|v| *v == 1.0), "{k}");
    }
}

/// A texture that is mirrored, one on the older material, and what is wrong with
/// some boxes.
#[test]
fn boxes_that_are_odd() {
    let front = |file: &str| Some(Front::of(read(file)?, [0.0, 0.0], 0.45, 90, 64));
    let Some(plain) = front("BoxTextured-glTF-Binary/BoxTextured.glb") else { return };
    // Its front runs from u = 5 to 6, where `mirror` turns it round.
    let mirrored = front("BoxTextured-glTF/BoxTextured.gltf").unwrap();
    let (mut same, mut turned) = (0.0, 0.0);
    for k in 0..90 * 90 {
        let (column, row) = (k % 90, k / 90);
        same += plain.pixel(column, row).distance(mirrored.pixel(column, row)) / 8100.0;
        turned += plain.pixel(column, row).distance(mirrored.pixel(89 - column, row)) / 8100.0;
    }
    println!("mirrored: off by {same} as it is, {turned} turned round");
    assert!(turned < 0.02 && same > 0.1, "{same} {turned}");
    // The older material: the same picture, darker.
    let old = front("pbrSpecularGlossiness/BoxTextured.gltf").unwrap();
    let (mut sums, n) = ([0.0f64; 5], plain.pixels.len() as f64);
    for (a, b) in plain.pixels.iter().zip(&old.pixels) {
        let (a, b) = (f64::from(*a), f64::from(*b));
        sums.iter_mut().zip([a, b, a * a, b * b, a * b]).for_each(|(sum, v)| *sum += v / n);
    }
    let [a, b, aa, bb, ab] = sums;
    let correlation = (ab - a * b) / ((aa - a * a) * (bb - b * b)).sqrt();
    println!("older material: correlation {correlation}");
    assert!(correlation > 0.95, "{correlation}");
    // Bad normals: red all over, and no bad samples (`picture` asserts that).
    let red = picture(&read("BoxBadNormals.glb").unwrap(), [96, 72], 16);
    let seen = red.chunks(3).filter(|c| c[1] < 0.9).count();
    let reds = red.chunks(3).filter(|c| c[0] > 3.0 * c[1] && c[0] > 3.0 * c[2]).count();
    println!("bad normals: {reds} of {seen} red");
    // What is left are the edges, where the filter mixes in the white behind.
    assert!(seen > 1000 && reds as f64 > 0.9 * seen as f64, "{reds} of {seen}");
    // Vertices that do not fill their triangles: what is whole is shown.
    let cube = read("IncorrectVertexArrays/Cube.gltf").unwrap();
    let left_out = cube.warnings.iter().filter(|w| w.contains("its last triangle is not complete")).count();
    let lines = cube.warnings.iter().filter(|w| w.contains("lines have no surface")).count();
    assert_eq!((left_out, lines), (2, 4), "{:?}", cube.warnings);
}

/// Four labelled tiles: yellow, orange, blue, green. The one whose only set of
/// coordinates is the second is shown in the colour of its texel at (0, 0).
#[test]
fn texture_coordinates() {
    let Some(desc) = read("texcoord_crash.gltf") else { return };
    let places: Vec<(String, DVec3)> = boxes(&desc);
    let front = Front::of(desc, [0.0, 0.0], 1.5, 300, 16);
    type Is = fn(Vec3) -> bool;
    let expected: [(&str, Is); 4] = [
        ("TopLeftObj", |c| c.x > 3.0 * c.z && c.y > 3.0 * c.z),
        ("TopRightObj", |c| c.x > 2.0 * c.y && c.x > 3.0 * c.z),
        ("BottomLeftObj", |c| c.z > 2.0 * c.y && c.z > 4.0 * c.x),
        ("BottomRightObj", |c| c.y > 4.0 * c.x && c.y > 4.0 * c.z),
    ];
    for (name, is) in expected {
        let (_, middle) = places.iter().find(|(n, _)| n == name).unwrap();
        let c = front.at(middle.x, middle.y);
        println!("{name} at {middle}: {c}");
        assert!(is(c), "{name}: {c}");
        let top = name.starts_with("Top");
        let left = name.contains("Left");
        assert!(top == (middle.y > 0.0) && left == (middle.x < 0.0), "{name} is at {middle}");
    }
}

/// The ribbon bends at its second joint by the angle of its key.
#[test]
fn skins_bend() {
    let Some(path) = model("simple_skin.gltf") else { return };
    for (seconds, half_sine) in [(0.0, 0.0), (0.5, 0.383), (1.0, 0.707), (4.5, -0.707)] {
        let options = LoadOptions { frame: Some(seconds * 24.0), ..LoadOptions::default() };
        let desc = load(&path, &options).unwrap();
        // The last corner, (1, 2), belongs to the second joint alone; both are
        // bound (0.5, 1) away.
        let angle: f64 = 2.0 * f64::asin(half_sine);
        let (sin, cos) = angle.sin_cos();
        let expected = DVec3::new(0.5 * cos - sin, 1.0 + 0.5 * sin + cos, 0.0);
        let found = desc.meshes[0].positions[9].as_dvec3();
        assert!(found.distance(expected) < 5e-3, "{seconds} s: {found}, not {expected}");
        // The first belongs to the first joint.
        assert!(desc.meshes[0].positions[0].distance(Vec3::new(-0.5, 0.0, 0.0)) < 1e-6);
    }
}

/// Where everything is in the world, by the transforms of the `gltf` crate.
#[test]
fn world_boxes() {
    let mut compared = 0;
    for path in models() {
        let (Ok(desc), Ok(file)) = (load(&path, &LoadOptions::default()), gltf::Gltf::open(&path)) else {
            continue;
        };
        let morphs = file.meshes().flat_map(|m| m.primitives()).any(|p| p.morph_targets().len() > 0);
        let packed = file.extensions_used().any(|e| e.contains("compression"));
        if morphs || packed || file.skins().len() > 0 {
            continue;
        }
        let Some(buffers) = buffers(&path, &file) else { continue };
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let scene = file.default_scene().or(file.scenes().next()).unwrap();
        let mut nodes: Vec<(gltf::Node, DMat4)> = scene.nodes().map(|n| (n, DMat4::IDENTITY)).collect();
        while let Some((node, parent)) = nodes.pop() {
            let local = DMat4::from_cols_array_2d(&node.transform().matrix().map(|c| c.map(f64::from)));
            let world = parent * local;
            nodes.extend(node.children().map(|child| (child, world)));
            for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
                use gltf::mesh::Mode;
                if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleFan | Mode::TriangleStrip) {
                    continue;
                }
                let reader = primitive.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
                let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
                let used: Vec<u32> = match reader.read_indices() {
                    Some(indices) => indices.into_u32().collect(),
                    None => (0..positions.len() as u32).collect(),
                };
                for index in used {
                    let p = world.transform_point3(Vec3::from(positions[index as usize]).as_dvec3());
                    (low, high) = (low.min(p), high.max(p));
                }
            }
        }
        if !low.is_finite() {
            continue;
        }
        let (ours_low, ours_high) = world(&desc);
        let size = (high - low).length();
        let off = ours_low.distance(low).max(ours_high.distance(high));
        assert!(off < 1e-4 * size, "{}: {ours_low} {ours_high}, not {low} {high}", path.display());
        compared += 1;
    }
    println!("{compared} files compared");
    assert!(compared == 0 || compared > 25, "{compared}");
}

/// Red wall to the left, green one to the right, lit by the lamp inside alone.
#[test]
fn a_cornell_box() {
    let Some(desc) = read("bevy/CornellBox/CornellBox.glb") else { return };
    let pixels = picture(&desc, [96, 72], 64);
    let (mut red, mut green, mut middle) = (0, 0, [0.0; 2]);
    for (k, c) in pixels.chunks(3).enumerate() {
        let column = (k % 96) as f64;
        if c[0] > 3.0 * c[1] && c[0] > 3.0 * c[2] {
            red += 1;
            middle[0] += column;
        }
        if c[1] > 3.0 * c[0] && c[1] > 3.0 * c[2] {
            green += 1;
            middle[1] += column;
        }
    }
    println!("{red} red and {green} green pixels");
    assert!(red > 150 && green > 80, "{red} {green}");
    assert!(middle[0] / f64::from(red) < middle[1] / f64::from(green));
    // Its lamp is double-sided.
    assert!(
        desc.objects.iter().any(|o| o.plugin == "area" && o.params.iter().any(|p| p.name == "two_sided"))
    );
}
