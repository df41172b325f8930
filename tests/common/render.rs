//! Renders scenes for tests: from XML in the test or from a file.

use std::path::{Path, PathBuf};

use etendue::desc::SceneDesc;
use etendue::film::{LayerSet, Picture};
use etendue::integrator::{Integrator, IntegratorOptions};
use etendue::load::{LoadOptions, load, load_str};
use etendue::render::{Quiet, RenderOptions, Rendered, TileOrder, render};
use etendue::sampling::Sequence;
use etendue::scene::{BuildOptions, Scene};

/// A path of the package.
#[allow(dead_code, reason = "not every test binary reads files")]
pub fn package(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Options for a small render.
pub fn options(samples_per_pixel: u64, seed: u64) -> RenderOptions {
    RenderOptions {
        samples_per_pixel,
        time: None,
        error: None,
        replicas: 0,
        seed,
        sequence: Sequence::Sobol,
        threads: 0,
        layers: LayerSet { alpha: true, error: true, ..LayerSet::default() },
        order: TileOrder::CentreOut,
    }
}

/// A scene with its integrator.
pub struct Ready {
    /// The scene.
    pub scene: Scene,
    /// Its integrator.
    pub integrator: Integrator,
}

impl Ready {
    /// Compiles a description; panics with the message on an error.
    pub fn build(desc: &SceneDesc, integrator: Option<&str>, accel: Option<&str>) -> Ready {
        let build = BuildOptions { accel: accel.map(str::to_owned), ..BuildOptions::default() };
        Ready::with(desc, integrator, &build)
    }

    /// With another size of the film.
    #[allow(dead_code, reason = "not every test binary uses it")]
    pub fn sized(desc: &SceneDesc, size: Option<[u32; 2]>) -> Ready {
        Ready::with(desc, None, &BuildOptions { size, ..BuildOptions::default() })
    }

    fn with(desc: &SceneDesc, integrator: Option<&str>, build: &BuildOptions) -> Ready {
        let scene = Scene::build(desc, build).unwrap_or_else(|e| panic!("{e}"));
        let choice =
            IntegratorOptions { name: integrator.map(str::to_owned), ..IntegratorOptions::default() };
        let integrator = Integrator::from_desc(desc, &choice).unwrap_or_else(|e| panic!("{e}"));
        Ready { scene, integrator }
    }

    /// From XML in the test.
    #[allow(dead_code, reason = "not every test binary uses XML")]
    pub fn from_xml(xml: &str, integrator: Option<&str>, accel: Option<&str>) -> Ready {
        let desc =
            load_str(xml, &package("tests/data"), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        Ready::build(&desc, integrator, accel)
    }

    /// From a file of the package.
    #[allow(dead_code, reason = "not every test binary reads files")]
    pub fn from_file(path: &str, defines: &[(&str, &str)]) -> Ready {
        let defines = defines.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        let options = LoadOptions { defines, ..LoadOptions::default() };
        let desc = load(&package(path), &options).unwrap_or_else(|e| panic!("{e}"));
        Ready::build(&desc, None, None)
    }

    /// Renders it.
    pub fn render(&self, options: &RenderOptions) -> Rendered {
        render(&self.scene, &self.integrator, options, &Quiet).unwrap_or_else(|e| panic!("{e}"))
    }

    /// The picture of `samples` per pixel.
    #[allow(dead_code, reason = "not every test binary uses it")]
    pub fn picture(&self, samples: u64, seed: u64) -> Picture {
        let rendered = self.render(&options(samples, seed));
        assert_eq!(rendered.stats.bad.total(), 0, "bad samples: {}", rendered.stats.bad.summary());
        rendered.film.resolve()
    }
}

/// R, G, B of every pixel, interleaved.
#[allow(dead_code, reason = "not every test binary uses it")]
pub fn rgb(picture: &Picture) -> Vec<f32> {
    let [r, g, b] = ["R", "G", "B"].map(|name| picture.channel(name).expect("a colour channel"));
    r.iter().zip(g).zip(b).flat_map(|((r, g), b)| [*r, *g, *b]).collect()
}

/// Mean over all pixels and channels.
#[allow(dead_code, reason = "not every test binary uses it")]
pub fn mean(picture: &Picture) -> f64 {
    let values = rgb(picture);
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}
