//! Files: the same bytes each time, names, windows, half floats, errors.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use etendue::film::{Channel, Picture, Rect};
use etendue::math::{DMat4, DVec3};
use etendue::save::{Curve, Header, Options, Saturated, Tone, write_exr, write_png};
use exr::prelude::{self as exr_crate, FlatSamples, ReadChannels, ReadLayers};

/// A crop of a larger film with layers, among them extreme values.
fn picture() -> Picture {
    let window = Rect::new(5, 9, 40, 37);
    let names = ["R", "G", "B", "A", "Z", "N.X", "N.Y", "N.Z", "albedo.R", "error.R"];
    let channels = names
        .iter()
        .enumerate()
        .map(|(c, name)| Channel {
            name: (*name).to_owned(),
            data: (0..window.area()).map(|i| ((i * 37 + c * 101) % 1009) as f32 * 0.013 - 0.5).collect(),
        })
        .collect();
    let mut picture = Picture { size: [64, 48], window, channels };
    picture.channels[0].data[3] = 1e30;
    picture.channels[0].data[4] = 65504.0;
    picture.channels[1].data[3] = -70000.0;
    picture.channels[4].data[3] = 1e30;
    picture.channels[4].data[4] = f32::INFINITY;
    picture
}

fn header() -> Header {
    let attributes = ["version", "scene", "seed", "samples", "plan", "bias", "bad_samples"];
    let attributes =
        attributes.iter().map(|n| (format!("etendue/{n}"), format!("value of {n}: café равнина"))).collect();
    Header {
        attributes,
        world_to_camera: Some(DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0))),
        world_to_ndc: Some(DMat4::from_scale(DVec3::new(0.5, 0.25, 1.0))),
        pixel_aspect: 1.5,
    }
}

fn read(path: &Path) -> exr_crate::Image<exr_crate::Layer<exr_crate::AnyChannels<FlatSamples>>> {
    let reader = exr_crate::read().no_deep_data().largest_resolution_level().all_channels();
    reader.first_valid_layer().all_attributes().from_file(path).expect("a file that was just written")
}

#[test]
fn bytes_are_the_same_each_time() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, options: Options| {
        let path = dir.path().join(name);
        write_exr(&path, &picture(), &header(), options).unwrap();
        fs::read(path).unwrap()
    };
    for options in [Options::default(), Options { half: true }] {
        let first = write("first.exr", options);
        for i in 0..8 {
            assert!(write(&format!("{i}.exr"), options) == first, "copy {i}");
        }
        assert!(write("first.exr", options) == first, "written over");
    }
    // Nothing unfinished is left behind.
    assert!(fs::read_dir(dir.path()).unwrap().all(|f| f.unwrap().path().extension().unwrap() == "exr"));
}

#[test]
fn files_read_back_as_they_were() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    assert_eq!(write_exr(&path, &picture(), &header(), Options::default()).unwrap(), []);
    let (image, picture) = (read(&path), picture());
    let layer = &image.layer_data;

    // Windows: the display window is the film, the data window the crop.
    assert_eq!(image.attributes.display_window.position, exr_crate::Vec2(0, 0));
    assert_eq!(image.attributes.display_window.size, exr_crate::Vec2(64, 48));
    assert_eq!(layer.attributes.layer_position, exr_crate::Vec2(5, 9));
    assert_eq!(layer.size, exr_crate::Vec2(40, 37));

    // Channels sorted by name, all values bit for bit.
    let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["A", "B", "G", "N.X", "N.Y", "N.Z", "R", "Z", "albedo.R", "error.R"]);
    for channel in &layer.channel_data.list {
        let FlatSamples::F32(data) = &channel.sample_data else { panic!("{} is not float", channel.name) };
        let expected = picture.channel(&channel.name.to_string()).unwrap();
        assert!(data.iter().zip(expected).all(|(a, b)| a.to_bits() == b.to_bits()), "{}", channel.name);
    }

    // One nameless part of scan lines, ZIP, increasing.
    assert_eq!(layer.attributes.layer_name, None);
    assert_eq!(layer.encoding.compression, exr_crate::Compression::ZIP16);
    assert_eq!(layer.encoding.blocks, exr_crate::Blocks::ScanLines);
    assert_eq!(layer.encoding.line_order, exr_crate::LineOrder::Increasing);

    // Attributes; matrices for row vectors: the translation is the last row.
    assert_eq!(image.attributes.pixel_aspect, 1.5);
    assert_eq!(image.attributes.chromaticities.unwrap().red, exr_crate::Vec2(0.64, 0.33));
    let camera = layer.attributes.world_to_camera.unwrap();
    assert_eq!(camera[12..], [1.0, 2.0, 3.0, 1.0]);
    let others: BTreeMap<String, &exr_crate::AttributeValue> =
        layer.attributes.other.iter().map(|(k, v)| (k.to_string(), v)).collect();
    assert_eq!(others.len(), 7);
    let exr_crate::AttributeValue::Text(seed) = others["etendue/seed"] else { panic!("not a text") };
    assert_eq!(seed.as_slice(), "value of seed: café равнина".as_bytes());
}

#[test]
fn header_attributes_are_in_order() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    write_exr(&path, &picture(), &header(), Options::default()).unwrap();
    let bytes = fs::read(&path).unwrap();
    let (mut at, mut names) = (8, Vec::new());
    while bytes[at] != 0 {
        let end = |from: usize| from + bytes[from..].iter().position(|b| *b == 0).unwrap();
        names.push(String::from_utf8(bytes[at..end(at)].to_vec()).unwrap());
        let size = end(end(at) + 1) + 1;
        at = size + 4 + i32::from_le_bytes(bytes[size..size + 4].try_into().unwrap()) as usize;
    }
    assert!(names.is_sorted() && names.len() > 15, "{names:?}");
    for expected in ["channels", "chromaticities", "etendue/plan", "worldToCamera", "worldToNDC"] {
        assert!(names.iter().any(|n| n == expected), "{expected}");
    }
    assert!(!names.iter().any(|n| n == "name"));
}

#[test]
fn halves_saturate_with_a_count_and_touch_rgba_only() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let saturated = write_exr(&path, &picture(), &header(), Options { half: true }).unwrap();
    let of = |channel: &str| Saturated { channel: channel.to_owned(), count: 1 };
    assert_eq!(saturated, [of("R"), of("G")]);
    let (image, picture) = (read(&path), picture());
    for channel in &image.layer_data.channel_data.list {
        let name = channel.name.to_string();
        let expected = picture.channel(&name).unwrap();
        match &channel.sample_data {
            FlatSamples::F16(data) => {
                assert!(["R", "G", "B", "A"].contains(&name.as_str()), "{name}");
                assert!(data.iter().all(|v| v.is_finite()));
                for (got, v) in data.iter().zip(expected) {
                    let v = v.clamp(-65504.0, 65504.0);
                    assert!((got.to_f32() - v).abs() <= v.abs() * 0.0005 + 1e-7, "{got} {v}");
                }
            }
            FlatSamples::F32(data) => {
                assert!(!["R", "G", "B", "A"].contains(&name.as_str()), "{name}");
                assert_eq!(data, expected);
            }
            FlatSamples::U32(_) => panic!("{name} is an integer"),
        }
    }
}

#[test]
fn overscan_has_a_data_window_beyond_the_display_window() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let picture = Picture {
        size: [4, 3],
        window: Rect::new(-2, -1, 8, 5),
        channels: vec![Channel { name: "R".into(), data: (0..40u8).map(f32::from).collect() }],
    };
    write_exr(&path, &picture, &Header::default(), Options::default()).unwrap();
    let image = read(&path);
    assert_eq!(image.layer_data.attributes.layer_position, exr_crate::Vec2(-2, -1));
    assert_eq!(image.attributes.display_window.size, exr_crate::Vec2(4, 3));
}

#[test]
fn errors_name_the_path_and_leave_the_old_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let good = picture();
    write_exr(&path, &good, &header(), Options::default()).unwrap();
    let before = fs::read(&path).unwrap();

    let mut bad = good.clone();
    bad.channels[2].name = "R".into();
    let error = write_exr(&path, &bad, &header(), Options::default()).unwrap_err().to_string();
    assert!(error.contains("a.exr") && error.contains("two channels called `R`"), "{error}");
    bad.channels[2].name = "B\0".into();
    assert!(write_exr(&path, &bad, &header(), Options::default()).is_err());
    bad.channels[2].name = "B".into();
    bad.channels[2].data.pop();
    let error = write_exr(&path, &bad, &header(), Options::default()).unwrap_err().to_string();
    assert!(error.contains("channel `B` has 1479 values for 1480 pixels"), "{error}");

    // A folder is in the way of the unfinished file.
    fs::create_dir(dir.path().join("a.exr.part")).unwrap();
    let error = write_exr(&path, &good, &header(), Options::default()).unwrap_err();
    assert!(error.message.contains("cannot write `") && error.hint.is_some(), "{error}");
    assert!(fs::read(&path).unwrap() == before);

    // A folder of the file's name: the rename fails, nothing is left behind.
    let folder = dir.path().join("b.exr");
    fs::create_dir_all(folder.join("inside")).unwrap();
    assert!(write_exr(&folder, &good, &header(), Options::default()).is_err());
    assert!(!dir.path().join("b.exr.part").exists());

    let missing = dir.path().join("nowhere").join("c.exr");
    let error = write_exr(&missing, &good, &header(), Options::default()).unwrap_err();
    assert!(error.hint.unwrap().starts_with("make the folder `"));
}

#[test]
fn previews_are_toned_and_cropped() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    let values = [0.0, 0.18, 1.0, 100.0];
    let channel = |name: &str| Channel { name: name.into(), data: values.to_vec() };
    let mut picture = Picture {
        size: [10, 10],
        window: Rect::new(2, 3, 2, 2),
        channels: ["R", "G", "B"].map(channel).to_vec(),
    };
    let levels = |tone: Tone, picture: &Picture| -> Vec<u8> {
        write_png(&path, picture, tone).unwrap();
        let png = image::open(&path).unwrap().to_rgb8();
        assert_eq!(png.dimensions(), (2, 2));
        assert!(png.pixels().all(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2]));
        png.pixels().map(|p| p.0[0]).collect()
    };
    assert_eq!(levels(Tone::default(), &picture), [0, 118, 255, 255]);
    assert_eq!(levels(Tone { exposure: -1.0, curve: Curve::Srgb }, &picture), [0, 85, 188, 255]);
    let agx = levels(Tone { exposure: 0.0, curve: Curve::Agx }, &picture);
    assert!(agx[0] == 0 && agx[1] == 118 && agx[2] < 230 && agx[3] > agx[2], "{agx:?}");
    let twice = fs::read(&path).unwrap();
    levels(Tone { exposure: 0.0, curve: Curve::Agx }, &picture);
    assert!(fs::read(&path).unwrap() == twice);

    picture.channels.truncate(2);
    let error = write_png(&path, &picture, Tone::default()).unwrap_err().to_string();
    assert!(error.ends_with("the picture has no channel `B`"), "{error}");
    assert_eq!(Curve::NAMES.iter().map(|n| Curve::from_name(n)).filter(Option::is_some).count(), 2);
}
