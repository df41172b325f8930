//! Files of Mitsuba 0.x, and files with things that nobody knows: what they
//! become, and what is said about it.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail like tests")]

use std::path::{Path, PathBuf};

use etendue::color::{spectrum_to_rgb, srgb_to_linear};
use etendue::desc::{Category, Object, SceneDesc, Value};
use etendue::integrator::{Integrator, IntegratorOptions};
use etendue::light::Observer;
use etendue::load::{LoadOptions, load, load_str};
use etendue::math::{DVec3, Rgb};
use etendue::scene::{BuildOptions, Scene};

/// Loads the body of a scene of version 0.6.
fn old(body: &str, lenient: bool) -> Result<SceneDesc, String> {
    let xml = format!("<scene version=\"0.6.0\">\n{body}\n</scene>");
    load_str(&xml, Path::new(""), &LoadOptions { lenient, ..LoadOptions::default() })
        .map_err(|e| e.to_string())
}

fn strict(body: &str) -> SceneDesc {
    old(body, false).unwrap()
}

fn find(scene: &SceneDesc, category: Category) -> &Object {
    scene.objects.iter().find(|o| o.category == category).unwrap()
}

fn value<'a>(object: &'a Object, name: &str) -> Option<&'a Value> {
    object.params.iter().find(|p| p.name == name).map(|p| &p.value)
}

fn float(object: &Object, name: &str) -> f64 {
    match value(object, name) {
        Some(Value::Float(v)) => *v,
        other => panic!("{name}: {other:?}"),
    }
}

fn colour(tag: &str) -> [f64; 3] {
    let scene = strict(&format!("<bsdf type=\"diffuse\">{tag}</bsdf>"));
    match value(find(&scene, Category::Bsdf), "reflectance") {
        Some(Value::Rgb(c)) => *c,
        other => panic!("{tag}: {other:?}"),
    }
}

/// Builds scene and integrator as `render` does; the notes of leniency.
fn build(desc: &SceneDesc) -> Result<Vec<String>, String> {
    Scene::build(desc, &BuildOptions { size: Some([8, 8]), ..BuildOptions::default() })
        .map_err(|e| e.to_string())?;
    Integrator::from_desc(desc, &IntegratorOptions::default()).map_err(|e| e.to_string())?;
    Ok(desc.replacements())
}

const SENSOR: &str = "<sensor type=\"perspective\"/>";

#[test]
fn colours() {
    let encoded = |v: f32| f64::from(srgb_to_linear(v));
    assert_eq!(colour("<rgb name=\"reflectance\" value=\"0.5\"/>"), [0.5; 3]);
    assert_eq!(
        colour("<rgb name=\"reflectance\" value=\".1 .2, .3\" intent=\"reflectance\"/>"),
        [0.1, 0.2, 0.3]
    );
    assert_eq!(colour("<spectrum name=\"reflectance\" value=\".1, .2, .3\"/>"), [0.1, 0.2, 0.3]);
    let hexadecimal = [1.0, encoded(0x80 as f32 / 255.0), 0.0];
    assert_eq!(colour("<srgb name=\"reflectance\" value=\"#ff8000\"/>"), hexadecimal);
    assert_eq!(colour("<rgb name=\"reflectance\" value=\"#FF8000\"/>"), hexadecimal);
    assert_eq!(colour("<srgb name=\"reflectance\" value=\"0.5\"/>"), [encoded(0.5); 3]);
    assert_eq!(colour("<srgb name=\"reflectance\" value=\"1, 0.5, 0\"/>"), [1.0, encoded(0.5), 0.0]);
    for (tag, message) in [
        ("<srgb name=\"r\" value=\"#ff80\"/>", "`r` must be a colour like `#f9aa34`, found `#ff80`"),
        ("<srgb name=\"r\" value=\"1 2\"/>", "a colour has 1 or 3 numbers, found 2"),
        (
            "<blackbody name=\"r\" temperature=\"hot\"/>",
            "`temperature` must be a temperature like `5000K`, found `hot`",
        ),
        ("<blackbody name=\"r\"/>", "`<blackbody>` needs the attribute `temperature`"),
        (
            "<spectrum name=\"r\" value=\"1 2\"/>",
            "`r` must be one number or `wavelength:value` pairs, found `1`",
        ),
    ] {
        let error = old(&format!("<bsdf type=\"diffuse\">{tag}</bsdf>"), false).unwrap_err();
        assert!(error.ends_with(message), "{error}");
    }
}

/// The colour of a black body is white at the temperature of the sun's
/// surface, red when cooler and blue when hotter; and it scales.
#[test]
fn black_bodies() {
    let rgb = |attributes: &str| {
        let tag = format!("<blackbody name=\"radiance\" {attributes}/>");
        let scene = strict(&format!("<emitter type=\"constant\">{tag}</emitter>"));
        match value(find(&scene, Category::Emitter), "radiance") {
            Some(Value::Spectrum(pairs)) => spectrum_to_rgb(pairs),
            other => panic!("{other:?}"),
        }
    };
    let [candle, sun, star] = ["2000K", "5778", "20000k"].map(|t| rgb(&format!("temperature=\"{t}\"")));
    assert!(candle.x > 2.0 * candle.y && candle.y > 2.0 * candle.z, "{candle}");
    assert!(star.z > 1.5 * star.x, "{star}");
    let grey = sun / sun.y;
    assert!((grey - Rgb::ONE).abs().max_element() < 0.2, "{grey}");
    // Planck at 5778 K and 555 nm: 2.575e4 W/(m² sr nm); the mean over ȳ is near.
    assert!((sun.y / 2.575e4 - 1.0).abs() < 0.05, "{sun}");
    let scaled = rgb("temperature=\"5778K\" scale=\"0.001\"");
    assert!((scaled * 1000.0 / sun - Rgb::ONE).abs().max_element() < 1e-6);
}

#[test]
fn look_at_has_both_spellings() {
    let transform = |tag: &str| {
        let body = format!(
            "<sensor type=\"perspective\"><transform name=\"toWorld\">\
             <{tag} origin=\"1 2 3\" target=\"4 5 6\" up=\"0 1 0\"/></transform></sensor>"
        );
        let scene = strict(&body);
        match value(find(&scene, Category::Sensor), "to_world") {
            Some(Value::Transform(t)) => t.matrix,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(transform("lookAt"), transform("lookat"));
}

/// What each leaf of a tree of blends weighs, with its plugin.
fn leaves(scene: &SceneDesc, object: &Object, weight: f64, out: &mut Vec<(String, f64)>) {
    if object.plugin != "blendbsdf" {
        out.push((object.plugin.clone(), weight));
        return;
    }
    let share = float(object, "weight");
    let parts: Vec<&Object> = object
        .params
        .iter()
        .filter_map(|p| if let Value::Object(id) = p.value { Some(scene.object(id)) } else { None })
        .collect();
    assert_eq!(parts.len(), 2);
    leaves(scene, parts[0], weight * (1.0 - share), out);
    leaves(scene, parts[1], weight * share, out);
}

#[test]
fn mixtures_are_blends() {
    let mixed = |weights: &str, parts: &[&str]| {
        let parts: String = parts.iter().map(|p| format!("<bsdf type=\"{p}\"/>")).collect();
        let body = format!(
            "<shape type=\"sphere\"><bsdf type=\"mixturebsdf\"><string name=\"weights\" value=\"{weights}\"/>{parts}</bsdf></shape>{SENSOR}"
        );
        let scene = strict(&body);
        build(&scene).unwrap();
        let mut out = Vec::new();
        leaves(&scene, find(&scene, Category::Bsdf), 1.0, &mut out);
        out
    };
    let check = |found: Vec<(String, f64)>, expected: &[(&str, f64)]| {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for ((plugin, weight), (name, share)) in found.iter().zip(expected) {
            assert!(plugin == name && (weight - share).abs() < 1e-12, "{found:?}");
        }
    };
    check(mixed("0.3, 0.7", &["plastic", "diffuse"]), &[("plastic", 0.3), ("diffuse", 0.7)]);
    check(
        mixed("0.1 0.2;0.3,0.4", &["plastic", "conductor", "dielectric", "diffuse"]),
        &[("plastic", 0.1), ("conductor", 0.2), ("dielectric", 0.3), ("diffuse", 0.4)],
    );
    // A rest of black, and more than all scaled down.
    check(
        mixed("0.5, 0.2", &["plastic", "conductor"]),
        &[("plastic", 0.5), ("conductor", 0.2), ("diffuse", 0.3)],
    );
    check(mixed("0.25", &["plastic"]), &[("plastic", 0.25), ("diffuse", 0.75)]);
    check(mixed("3, 1", &["plastic", "conductor"]), &[("plastic", 0.75), ("conductor", 0.25)]);
    check(mixed("1", &["plastic"]), &[("plastic", 1.0), ("diffuse", 0.0)]);
    check(mixed("0, 1", &["plastic", "conductor"]), &[("plastic", 0.0), ("conductor", 1.0)]);
    for weights in ["0.5", "a, b", "0, 0", "-1, 1", ""] {
        let body = format!(
            "<bsdf type=\"mixturebsdf\"><string name=\"weights\" value=\"{weights}\"/><bsdf type=\"plastic\"/><bsdf type=\"diffuse\"/></bsdf>"
        );
        assert!(old(&body, false).unwrap_err().contains("bsdf `mixturebsdf` needs"), "{weights}");
    }
}

/// Exact translations beside mixtures.
#[test]
fn kinds_of_old() {
    let scene = strict("<bsdf type=\"roughdiffuse\"><float name=\"alpha\" value=\"0\"/></bsdf>");
    assert_eq!(find(&scene, Category::Bsdf).plugin, "diffuse");
    let scene = strict("<bsdf type=\"conductor\"/>");
    assert!(matches!(value(find(&scene, Category::Bsdf), "material"), Some(Value::String(m)) if m == "Cu"));
    let scene = strict(
        "<bsdf type=\"conductor\"><spectrum name=\"eta\" value=\"3\"/><float name=\"extEta\" value=\"1.5\"/></bsdf>",
    );
    assert!(matches!(value(find(&scene, Category::Bsdf), "eta"), Some(Value::Rgb(c)) if c == &[2.0; 3]));
    let scene =
        strict("<integrator type=\"volpath_simple\"><integer name=\"maxDepth\" value=\"3\"/></integrator>");
    assert_eq!(find(&scene, Category::Integrator).plugin, "volpath");
    let scene = strict(
        "<integrator type=\"bdpt\"><integer name=\"maxDepth\" value=\"4\"/><boolean name=\"lightImage\" value=\"true\"/></integrator>",
    );
    let integrator = find(&scene, Category::Integrator);
    assert_eq!((integrator.plugin.as_str(), integrator.params.len()), ("volpath", 1));
    assert!(scene.warnings.iter().any(|w| w.contains("integrator `bdpt` makes way for `volpath`")));
    let scene = strict(
        "<medium type=\"homogeneous\"><rgb name=\"sigmaS\" value=\"1, 0, 0\"/><rgb name=\"sigmaA\" value=\"3, 2, 0\"/></medium>",
    );
    let medium = find(&scene, Category::Medium);
    assert!(matches!(value(medium, "sigma_t"), Some(Value::Rgb([4.0, 2.0, 0.0]))));
    assert!(matches!(value(medium, "albedo"), Some(Value::Rgb([0.25, 0.0, 0.0]))));
    let scene = strict(
        "<film type=\"ldrfilm\"><float name=\"gamma\" value=\"-1\"/><string name=\"pixelFormat\" value=\"luminanceAlpha\"/>\
         <boolean name=\"highQualityEdges\" value=\"true\"/><string name=\"fileFormat\" value=\"png\"/></film>",
    );
    let film = find(&scene, Category::Film);
    assert_eq!((film.plugin.as_str(), film.params.len()), ("hdrfilm", 2));
    assert!(matches!(value(film, "sample_border"), Some(Value::Bool(true))));
    assert!(scene.warnings[0].contains("tone mapping is left to --exposure and --tone"));
}

/// What has no equal fails with the nearest, and is replaced by it if asked.
#[test]
fn what_has_no_equal() {
    let cases = [
        (
            "<bsdf type=\"phong\"><float name=\"exponent\" value=\"98\"/></bsdf>",
            "bsdf `phong` is not known; the nearest is a `blendbsdf` of `diffuse` and `roughconductor`",
            "replaced by a blend of `diffuse` and `roughconductor`",
        ),
        (
            "<bsdf type=\"ward\"><float name=\"alphaU\" value=\"0.2\"/><rgb name=\"specularReflectance\" value=\"0.1 0.2 0\"/></bsdf>",
            "bsdf `ward` is not known; the nearest is a `blendbsdf` of `diffuse` and `roughconductor`",
            "replaced by a blend of `diffuse` and `roughconductor`",
        ),
        (
            "<bsdf type=\"roughdiffuse\"/>",
            "bsdf `roughdiffuse` is not known; the nearest is `diffuse`",
            "replaced by `diffuse`",
        ),
        (
            "<bsdf type=\"difftrans\"/>",
            "bsdf `difftrans` is not known: no diffuse transmission",
            "replaced by a `diffuse` that reflects what went through",
        ),
        (
            "<bsdf type=\"coating\"><float name=\"thickness\" value=\"1\"/><bsdf type=\"diffuse\"/></bsdf>",
            "bsdf `coating` is not known; the nearest are `plastic` and `roughplastic`",
            "replaced by `plastic`",
        ),
        (
            "<bsdf type=\"roughcoating\"><bsdf type=\"conductor\"/></bsdf>",
            "bsdf `roughcoating` is not known; the nearest are `plastic` and `roughplastic`",
            "replaced by the `conductor` within",
        ),
        ("<bsdf type=\"irawan\"/>", "bsdf `irawan` is not known", "replaced by a grey `diffuse`"),
        (
            "<bsdf type=\"roughplastic\"><string name=\"distribution\" value=\"phong\"/></bsdf>",
            "`distribution` has no value `phong`",
            "replaced by `beckmann` of the same roughness",
        ),
        (
            "<integrator type=\"vpl\"><integer name=\"maxDepth\" value=\"4\"/><float name=\"clamping\" value=\"0.1\"/></integrator>",
            "integrator `vpl` is not known; `path` makes the picture its own way",
            "replaced by `path`",
        ),
        (
            "<shape type=\"sphere\"><bsdf type=\"diffuse\"/><bsdf type=\"plastic\"/></shape>",
            "a shape has one bsdf only: `usemtl` does not part it",
            "left with the first of them",
        ),
        (
            "<texture type=\"gridtexture\"><rgb name=\"color0\" value=\"0.7\"/></texture>",
            "texture `gridtexture` is not known",
            "replaced by its colour between the lines",
        ),
    ];
    for (body, message, outcome) in cases {
        let error = old(body, false).unwrap_err();
        assert!(error.starts_with("<string>:2:") && error.contains(message), "{error}");
        assert!(error.ends_with(&format!("; with --lenient it is {outcome}")), "{error}");
        let scene = old(&format!("{body}{SENSOR}"), true).unwrap();
        let notes = build(&scene).unwrap();
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].contains(&format!("{message}; {outcome}")), "{notes:?}");
    }
    let hair = "<shape type=\"hair\"/>";
    assert_eq!(
        old(hair, false).unwrap_err(),
        "<string>:2:1: shape `hair` is not supported; with --lenient it is left out"
    );
    let scene = old(&format!("{hair}{SENSOR}"), true).unwrap();
    assert_eq!(build(&scene).unwrap(), ["<string>:2:1: unknown shape `hair`; left out"]);
}

/// A Phong lobe of exponent 98 is as narrow as α = √(2/100), and its share of
/// the light goes to the lobe.
#[test]
fn phong_as_a_blend() {
    let scene = old(
        "<bsdf type=\"phong\"><float name=\"exponent\" value=\"98\"/><rgb name=\"specularReflectance\" value=\"0.1 0.4 0\"/>\
         <rgb name=\"diffuseReflectance\" value=\"0.3 0.6 0.9\"/></bsdf>",
        true,
    )
    .unwrap();
    let of = |plugin: &str| scene.objects.iter().find(|o| o.plugin == plugin).unwrap();
    assert!((float(of("blendbsdf"), "weight") - 0.4).abs() < 1e-12);
    assert!((float(of("roughconductor"), "alpha") - 0.02f64.sqrt()).abs() < 1e-12);
    let rgb = |plugin: &str, name: &str| match value(of(plugin), name) {
        Some(Value::Rgb(c)) => DVec3::from(*c),
        other => panic!("{other:?}"),
    };
    let off = |a: DVec3, b: [f64; 3]| (a - DVec3::from(b)).abs().max_element();
    assert!(off(rgb("roughconductor", "specular_reflectance"), [0.25, 1.0, 0.0]) < 1e-12);
    assert!(off(rgb("diffuse", "reflectance"), [0.5, 1.0, 1.0]) < 1e-12);
}

/// The sky of 0.x had y up and −z in the north.
#[test]
fn old_skies_are_turned() {
    let sky = |body: &str| {
        let scene = strict(&format!("<emitter type=\"sky\">{body}</emitter>"));
        let sky = find(&scene, Category::Emitter).clone();
        assert_eq!(sky.plugin, "sunsky");
        let Some(Value::Vector(sun)) = value(&sky, "sun_direction") else { panic!() };
        let Some(Value::Transform(to_world)) = value(&sky, "to_world") else { panic!() };
        (*sun, *to_world, sky)
    };
    let (sun, to_world, object) =
        sky("<float name=\"hour\" value=\"9\"/><float name=\"scale\" value=\"3\"/>");
    let expected = Observer { clock: [9.0, 0.0, 0.0], ..Observer::default() }.sun();
    assert!((sun.y - expected.zenith.cos()).abs() < 1e-12);
    // In the morning the sun is in the east: +x.
    assert!(sun.x > 0.5 && (sun.x - expected.zenith.sin() * expected.azimuth.sin()).abs() < 1e-12);
    assert!((to_world.vector(DVec3::Z) - DVec3::Y).length() < 1e-12);
    assert_eq!((float(&object, "sun_scale"), float(&object, "sky_scale")), (0.0, 3.0));
    let turned = "<transform name=\"toWorld\"><rotate x=\"1\" angle=\"90\"/></transform><float name=\"hour\" value=\"9\"/>";
    let (turned, to_world, _) = sky(turned);
    assert!((turned - DVec3::new(sun.x, -sun.z, sun.y)).length() < 1e-12);
    assert!((to_world.vector(DVec3::Z) - DVec3::Z).length() < 1e-12);
}

/// A sun and a sky of the same hour are one surrounding; of different hours
/// they cannot be.
#[test]
fn a_sun_beside_a_sky() {
    let pair = |hour: u32| {
        let at = |name: &str, hour: u32| {
            format!(
                "<emitter type=\"{name}\"><float name=\"hour\" value=\"{hour}\"/><float name=\"scale\" value=\"2\"/></emitter>"
            )
        };
        strict(&format!("{}{}{SENSOR}", at("sun", 10), at("sky", hour)))
    };
    let scene = pair(10);
    build(&scene).unwrap();
    let root = scene.object(scene.root);
    let skies: Vec<&Object> = root
        .params
        .iter()
        .filter_map(|p| if let Value::Object(id) = p.value { Some(scene.object(id)) } else { None })
        .filter(|o| o.category == Category::Emitter)
        .collect();
    assert_eq!(skies.len(), 1);
    assert_eq!((float(skies[0], "sun_scale"), float(skies[0], "sky_scale")), (2.0, 2.0));
    assert!(build(&pair(11)).unwrap_err().contains("a scene has one environment only"));
}

/// Everything that leniency replaces, and what it says.
#[test]
fn leniency_names_what_it_replaces() {
    let body = "<sensor type=\"perspective\"><film type=\"hdrfilm\"><rfilter type=\"wsinc\"/></film></sensor>
<integrator type=\"mlt\"><integer name=\"max_depth\" value=\"7\"/></integrator>
<emitter type=\"collimated\"/>
<emitter type=\"envmap\"><string name=\"filename\" value=\"sky.exr\"/></emitter>
<shape type=\"sphere\"><float name=\"radus\" value=\"2\"/>
<bsdf type=\"twosided\"><bsdf type=\"velvet\"><float name=\"x\" value=\"1\"/></bsdf></bsdf>
<medium type=\"homogeneous\" name=\"interior\"/></shape>
<shape type=\"rectangle\"><bsdf type=\"diffuse\"><texture type=\"marble\" name=\"reflectance\"/></bsdf></shape>
<shape type=\"rectangle\"><bsdf type=\"normalmap\"><texture type=\"bitmap\" name=\"normalmap\"><string name=\"filename\" value=\"n.png\"/></texture><bsdf type=\"diffuse\"/></bsdf></shape>
<shape type=\"metaball\"/>
<shape type=\"obj\"><string name=\"filename\" value=\"none.obj\"/></shape>
<subsurface type=\"dipole\"><float name=\"scale\" value=\"1\"/></subsurface>
<bsdf type=\"roughconductor\"><string name=\"distribution\" value=\"gggx\"/></bsdf>";
    let xml = format!("<scene version=\"3.0.0\">\n{body}\n</scene>");
    let lenient = LoadOptions { lenient: true, ..LoadOptions::default() };
    let desc = load_str(&xml, Path::new(""), &lenient).unwrap();
    let mut notes = build(&desc).unwrap();
    notes.sort();
    let expected = [
        "<string>:10:48: cannot find the file `n.png`; replaced by mid grey",
        "<string>:11:1: unknown shape `metaball`; left out",
        "<string>:12:20: cannot find the file `none.obj`; left out",
        "<string>:13:1: unknown tag `<subsurface>`; left out",
        "<string>:14:29: `distribution` has no value `gggx`; replaced by `beckmann`",
        "<string>:2:51: unknown rfilter `wsinc`; replaced by the default filter",
        "<string>:3:1: unknown integrator `mlt`; replaced by `path`",
        "<string>:4:1: unknown emitter `collimated`; left out",
        "<string>:5:24: cannot find the file `sky.exr`; replaced by a grey surrounding",
        "<string>:6:23: shape `sphere` takes no parameter `radus`; ignored",
        "<string>:7:23: unknown bsdf `velvet`; replaced by a grey `diffuse`",
        "<string>:8:1: participating media that scatter are not supported; left out",
        "<string>:9:48: unknown texture `marble`; replaced by mid grey",
    ];
    assert_eq!(notes.len(), expected.len(), "{notes:#?}");
    for (note, expected) in notes.iter().zip(expected) {
        let place = |text: &str| {
            text.split_once(": ").map(|(p, m)| (p.rsplit_once(':').unwrap().0.to_owned(), m.to_owned()))
        };
        assert_eq!(place(note), place(expected), "{note}");
    }
    // Each of them is an error without it.
    let error = load_str(&xml, Path::new(""), &LoadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("unknown tag `<subsurface>`"), "{error}");
}

/// A file without a version is old.
#[test]
fn no_version_is_an_old_one() {
    let xml = format!(
        "<scene>{SENSOR}<bsdf type=\"diffuse\"><srgb name=\"reflectance\" value=\"#ffffff\"/></bsdf></scene>"
    );
    let lenient = LoadOptions { lenient: true, ..LoadOptions::default() };
    let desc = load_str(&xml, Path::new(""), &lenient).unwrap();
    let notes = build(&desc).unwrap();
    assert_eq!(notes, ["<string>:1:1: the root tag `<scene>` needs a version; read as version 0.6.0"]);
    assert!(load_str(&xml, Path::new(""), &LoadOptions::default()).is_err());
}

/// Scenes as found, where they are at hand: which load as they are, and that
/// all of them do with `--lenient`.
#[test]
fn scenes_as_found() {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let dir = std::env::var_os("ETENDUE_SHARED").map_or(beside, PathBuf::from).join("scenes/wild");
    if !dir.is_dir() {
        return;
    }
    for (name, as_it_is) in [
        ("cbox-0.6/cbox.xml", Ok(())),
        ("cbox-0.6/cbox-improved.xml", Ok(())),
        ("cbox-with-bulb/scene.xml", Err("cannot find the file `meshes/sphere.obj`")),
        ("cbox-with-bulb/simple.xml", Err("cannot find the file `meshes/sphere.obj`")),
        ("redner/cbox/cbox.xml", Ok(())),
        ("redner/teapot.xml", Ok(())),
        ("redner/teapot_specular.xml", Ok(())),
        ("redner/living-room-3-scene.xml", Err("cannot find the file `textures/Abstract.jpg`")),
        ("torus-0.6/scene.xml", Err("bsdf `conductor` takes no parameter `alpha`")),
    ] {
        let read = |lenient| {
            let options = LoadOptions { lenient, ..LoadOptions::default() };
            let desc = load(&dir.join(name), &options).map_err(|e| e.to_string())?;
            build(&desc)
        };
        match (read(false), as_it_is) {
            (Ok(_), Ok(())) => {}
            (Err(error), Err(expected)) => assert!(error.contains(expected), "{name}: {error}"),
            (found, _) => panic!("{name}: {found:?}"),
        }
        let notes = read(true).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(notes.is_empty(), as_it_is.is_ok(), "{name}: {notes:?}");
    }
}

/// Parameters of old bitmaps, and the texture `scale`.
#[test]
fn old_textures() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::from_pixel(2, 2, image::Rgb([200, 100, 50])).save(folder.path().join("a.png")).unwrap();
    let read = |body: &str, lenient: bool| {
        let xml = format!("<scene version=\"0.6.0\">{body}{SENSOR}</scene>");
        let options = LoadOptions { lenient, ..LoadOptions::default() };
        load_str(&xml, folder.path(), &options).map_err(|e| e.to_string())
    };
    let bitmap = |more: &str| {
        format!("<texture type=\"bitmap\"><string name=\"filename\" value=\"a.png\"/>{more}</texture>")
    };
    let word = |name: &str, value: &str| format!("<string name=\"{name}\" value=\"{value}\"/>");

    let exact = format!(
        "{}{}{}<float name=\"gamma\" value=\"1\"/><float name=\"maxAnisotropy\" value=\"8\"/><boolean name=\"cache\" value=\"true\"/>",
        word("filterType", "ewa"),
        word("wrapModeU", "clamp"),
        word("wrapModeV", "mirror"),
    ) + &word("channel", "g");
    let scene = read(&bitmap(&exact), false).unwrap();
    build(&scene).unwrap();
    let texture = find(&scene, Category::Texture);
    assert!(matches!(value(texture, "raw"), Some(Value::Bool(true))));
    for (name, expected) in [("wrap_mode_u", "clamp"), ("wrap_mode_v", "mirror"), ("channel", "g")] {
        assert!(matches!(value(texture, name), Some(Value::String(w)) if w == expected), "{name}");
    }
    assert_eq!(texture.params.len(), 6, "{texture:?}");
    assert!(scene.warnings[0].ends_with("`filter_type` of a texture becomes `bilinear`"));

    for (more, message, outcome) in [
        (word("wrapMode", "zero"), "`wrap_mode` has no value `zero`", "replaced by `clamp`"),
        (word("wrapModeU", "black"), "`wrap_mode_u` has no value `black`", "replaced by `clamp`"),
        (
            "<float name=\"gamma\" value=\"2.2\"/>".to_owned(),
            "a texture is linear or sRGB here, not of gamma 2.2",
            "replaced by sRGB",
        ),
        (word("channel", "y"), "a texture has no channel `y`", "replaced by all of them"),
    ] {
        assert!(read(&bitmap(&more), false).unwrap_err().contains(message), "{message}");
        let notes = build(&read(&bitmap(&more), true).unwrap()).unwrap();
        assert_eq!(notes, [format!("<string>:1:24: {message}; {outcome}")]);
    }

    // A scaled colour is a colour, a scaled height belongs to the bump map.
    let colour = "<texture type=\"scale\"><float name=\"scale\" value=\"0.5\"/><rgb name=\"value\" value=\"0.2 0.4 0.6\"/></texture>";
    let scene = read(colour, false).unwrap();
    assert!(
        matches!(value(find(&scene, Category::Texture), "value"), Some(Value::Rgb(c)) if c == &[0.1, 0.2, 0.3])
    );
    let scaled =
        format!("<texture type=\"scale\"><float name=\"scale\" value=\"3\"/>{}</texture>", bitmap(""));
    let bump = format!("<bsdf type=\"bumpmap\">{scaled}<bsdf type=\"diffuse\"/></bsdf>");
    let scene = read(&bump, false).unwrap();
    build(&scene).unwrap();
    assert_eq!(float(find(&scene, Category::Bsdf), "scale"), 3.0);
    let reflectance = scaled.replacen("type", "name=\"reflectance\" type", 1);
    let diffuse = format!("<bsdf type=\"diffuse\">{reflectance}</bsdf>");
    let scene = read(&diffuse, false).unwrap();
    build(&scene).unwrap();
    let factor = |scene: &SceneDesc| value(find(scene, Category::Texture), "scale").cloned();
    assert!(matches!(factor(&scene), Some(Value::Rgb([3.0, 3.0, 3.0]))));
    // One in another: the inner one first.
    let twice = format!(
        "<bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"scale\">\
         <float name=\"scale\" value=\"0.5\"/>{scaled}</texture></bsdf>"
    );
    assert!(matches!(factor(&read(&twice, false).unwrap()), Some(Value::Rgb([1.5, 1.5, 1.5]))));
    let board = scaled.replacen(&bitmap(""), "<texture type=\"checkerboard\"/>", 1);
    let board =
        format!("<bsdf type=\"diffuse\">{}</bsdf>", board.replacen("type", "name=\"reflectance\" type", 1));
    assert!(read(&board, false).unwrap_err().contains("a texture `checkerboard` cannot be scaled"));
    build(&read(&board, true).unwrap()).unwrap();
}

/// What is replaced by something old is replaced by what that is today.
#[test]
fn replacements_are_of_today() {
    let scene = |body: &str| old(&format!("{body}{SENSOR}"), true).unwrap();
    let coated = scene("<bsdf type=\"coating\"><bsdf type=\"conductor\"/></bsdf>");
    let outer = coated.objects.iter().find(|o| o.category == Category::Bsdf).unwrap();
    assert!(
        outer.plugin == "conductor"
            && matches!(value(outer, "material"), Some(Value::String(m)) if m == "Cu")
    );
    let phong = scene("<bsdf type=\"coating\"><bsdf type=\"phong\"/></bsdf>");
    assert_eq!(phong.objects.iter().find(|o| o.category == Category::Bsdf).unwrap().plugin, "blendbsdf");
    let twice = scene(
        "<bsdf id=\"a\" type=\"diffuse\"><rgb name=\"reflectance\" value=\"1 0 0\"/></bsdf>\
         <shape type=\"sphere\"><ref id=\"a\"/><ref id=\"a\"/></shape>",
    );
    let sphere = find(&twice, Category::Shape);
    assert_eq!(sphere.params.iter().filter(|p| matches!(p.value, Value::Object(_))).count(), 1);
}

/// What an old file says and cannot mean is refused, not left aside.
#[test]
fn old_nonsense_is_refused() {
    let sky = |inner: &str| old(&format!("<emitter type=\"sky\">{inner}</emitter>{SENSOR}"), false);
    for (inner, message) in [
        ("<integer name=\"year\" value=\"9223372036854775807\"/>", "`year` is no part of a date"),
        ("<float name=\"day\" value=\"1.5\"/>", "`day` is no part of a date"),
        ("<string name=\"sunDirection\" value=\"up\"/>", "`sun_direction` must be a vector, found string"),
        ("<float name=\"sunRadiusScale\" value=\"1e-6\"/>", "a sun of no size to speak of"),
    ] {
        let error = sky(inner).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
    let film = old(
        "<sensor type=\"perspective\"><film type=\"hdrfilm\"><float name=\"exposure\" value=\"2\"/></film></sensor>",
        false,
    );
    assert!(build(&film.unwrap()).unwrap_err().contains("takes no parameter `exposure`"));
}
