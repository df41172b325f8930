//! Builds and renders the small scenes of rows. They are Mitsuba scenes in
//! text, so that the same ones can be given to other renderers.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::sheet::{Effort, SEEDS};
use super::{Options, meshes};
use crate::desc::{Error, Mesh, Result};
use crate::film::{Channel, LayerSet, Picture, Rect};
use crate::integrator::{Integrator, IntegratorOptions};
use crate::load::{LoadOptions, load_str};
use crate::render::{Quiet, RenderOptions, Rendered, TileOrder, render};
use crate::sampling::Sequence;
use crate::save::{Header, Options as SaveOptions, write_exr};
use crate::scene::{BuildOptions, Scene};

/// A scene seen through a keyhole: 4 × 4 pixels of a view so narrow that all
/// show one point, or `fov` degrees where the whole picture has one radiance.
#[derive(Clone, Debug)]
pub(super) struct Still {
    /// Everything but integrator and sensor.
    pub body: String,
    /// Where the camera is.
    pub from: [f64; 3],
    /// What it looks at.
    pub to: [f64; 3],
    /// Full angle of the view, degrees.
    pub fov: f64,
    /// `path`, `direct`…: the attribute and what is in the element.
    pub integrator: String,
    /// Samples per pixel of one render of the fast kind.
    pub samples: u64,
    /// Pixels of each side.
    pub size: u32,
    /// The element of another camera up to its film.
    pub camera: Option<String>,
    /// Other renderers do not know what is in it.
    pub unshared: bool,
}

impl Still {
    pub(super) fn new(body: impl Into<String>, from: [f64; 3], to: [f64; 3]) -> Still {
        let integrator = path(-1);
        Still {
            body: body.into(),
            from,
            to,
            fov: 0.01,
            integrator,
            samples: 64,
            size: 4,
            camera: None,
            unshared: false,
        }
    }

    pub(super) fn samples(mut self, samples: u64) -> Still {
        self.samples = samples;
        self
    }

    pub(super) fn integrator(mut self, xml: impl Into<String>) -> Still {
        self.integrator = xml.into();
        self
    }

    pub(super) fn view(mut self, fov: f64, size: u32) -> Still {
        (self.fov, self.size) = (fov, size);
        self
    }

    /// Another camera, such as [`ortho`].
    pub(super) fn seen_by(mut self, camera: &str) -> Still {
        self.camera = Some(camera.to_owned());
        self
    }

    pub(super) fn unshared(mut self) -> Still {
        self.unshared = true;
        self
    }

    fn keyhole(&self) -> String {
        let ([ax, ay, az], [bx, by, bz]) = (self.from, self.to);
        let up = if (ax - bx).abs() + (az - bz).abs() < 1e-9 * (ay - by).abs() { "0,0,1" } else { "0,1,0" };
        let far = [ax - bx, ay - by, az - bz].iter().map(|x| x * x).sum::<f64>().sqrt();
        format!(
            "<sensor type=\"perspective\"><float name=\"fov\" value=\"{}\"/>\n\
             <float name=\"near_clip\" value=\"{:e}\"/><float name=\"far_clip\" value=\"{:e}\"/>\n\
             <transform name=\"to_world\"><lookat origin=\"{ax:e},{ay:e},{az:e}\" \
             target=\"{bx:e},{by:e},{bz:e}\" up=\"{up}\"/></transform>",
            self.fov,
            far * 1e-6,
            far * 1e6
        )
    }

    /// The scene file.
    pub(super) fn xml(&self) -> String {
        let camera = self.camera.clone().unwrap_or_else(|| self.keyhole());
        format!(
            "<scene version=\"3.0.0\">\n{}\n{camera}\n<film type=\"hdrfilm\"><integer name=\"width\" value=\"{}\"/>\
             <integer name=\"height\" value=\"{}\"/>\
             <string name=\"component_format\" value=\"float32\"/><rfilter type=\"box\"/></film>\n\
             <sampler type=\"multijitter\"><integer name=\"sample_count\" value=\"{}\"/></sampler></sensor>\n\
             {}\n</scene>\n",
            self.integrator, self.size, self.size, self.samples, self.body
        )
    }
}

/// A floor of reflectance ½ of half-size 1 at y = 0.
pub(super) const FLOOR: &str = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>"#;

/// A path integrator; -1 has no limit.
pub(super) fn path(max_depth: i64) -> String {
    format!(r#"<integrator type="path"><integer name="max_depth" value="{max_depth}"/></integrator>"#)
}

/// The same without roulette: the paths go on to `max_depth`.
pub(super) fn path_unended(max_depth: i64) -> String {
    format!(
        r#"<integrator type="path"><integer name="max_depth" value="{max_depth}"/>
        <integer name="rr_depth" value="100000"/></integrator>"#
    )
}

/// A camera with parallel rays whose film is a square of `half` on each side of
/// what it looks at.
pub(super) fn ortho(from: [f64; 3], to: [f64; 3], half: f64) -> String {
    let ([ax, ay, az], [bx, by, bz]) = (from, to);
    let up = if ax == bx && az == bz { "0,0,1" } else { "0,1,0" };
    format!(
        "<sensor type=\"orthographic\"><float name=\"near_clip\" value=\"1e-6\"/>\
         <transform name=\"to_world\"><scale x=\"{half:e}\" y=\"{half:e}\"/>\
         <lookat origin=\"{ax:e},{ay:e},{az:e}\" target=\"{bx:e},{by:e},{bz:e}\" up=\"{up}\"/></transform>"
    )
}

/// A diffuse bsdf of grey `albedo`.
pub(super) fn diffuse(albedo: f64) -> String {
    format!(r#"<bsdf type="diffuse"><rgb name="reflectance" value="{albedo}"/></bsdf>"#)
}

/// The same, from both sides.
pub(super) fn twosided(albedo: f64) -> String {
    format!(r#"<bsdf type="twosided">{}</bsdf>"#, diffuse(albedo))
}

/// An area light of grey `radiance`.
pub(super) fn glow(radiance: f64) -> String {
    format!(r#"<emitter type="area"><rgb name="radiance" value="{radiance:e}"/></emitter>"#)
}

/// Surroundings of grey `radiance`.
pub(super) fn sky(radiance: f64) -> String {
    format!(r#"<emitter type="constant"><rgb name="radiance" value="{radiance:e}"/></emitter>"#)
}

/// Means of independent renders.
pub(super) struct Means {
    pub values: Vec<f64>,
    /// What was left out, if anything.
    pub dropped: Option<String>,
}

/// A scene with its integrator.
pub(super) struct Ready {
    pub scene: Scene,
    pub integrator: Integrator,
}

/// Builds and renders for one row, and keeps its files.
#[derive(Debug)]
pub(super) struct Workshop {
    id: &'static str,
    pub(super) effort: Effort,
    pub(super) seed: u64,
    accel: Option<String>,
    export: Option<PathBuf>,
    offered: Vec<serde_json::Value>,
    files: Option<tempfile::TempDir>,
    /// Files named so far.
    named: u32,
}

impl Workshop {
    pub(super) fn new(id: &'static str, options: &Options) -> Workshop {
        Workshop {
            id,
            effort: options.effort,
            seed: options.seed,
            accel: options.accel.clone(),
            export: options.export.clone(),
            offered: Vec::new(),
            files: None,
            named: 0,
        }
    }

    /// A folder for files that nobody else needs.
    pub(super) fn scratch(&mut self) -> Result<PathBuf> {
        self.folder()
    }

    /// The folder that file names in scenes are relative to.
    fn folder(&mut self) -> Result<PathBuf> {
        if let Some(folder) = &self.export {
            return Ok(folder.clone());
        }
        let files = match self.files.take() {
            Some(files) => files,
            None => tempfile::tempdir()
                .map_err(|e| Error::new(format!("cannot make a folder for scene files: {e}")))?,
        };
        Ok(self.files.insert(files).path().to_path_buf())
    }

    /// No two files of a row have the same name: scenes written earlier keep theirs.
    fn new_name(&mut self, name: &str) -> String {
        self.named += 1;
        format!("{}-{}-{name}", self.id, self.named)
    }

    /// Writes a mesh for scenes to name; returns the name.
    pub(super) fn mesh(&mut self, name: &str, mesh: &Mesh) -> Result<String> {
        self.file(&format!("{name}.ply"), &meshes::ply(mesh))
    }

    /// Writes a file for scenes to name; returns the name.
    pub(super) fn file(&mut self, name: &str, bytes: &[u8]) -> Result<String> {
        let name = self.new_name(name);
        write(&self.folder()?.join(&name), bytes)?;
        Ok(name)
    }

    /// Writes a picture of 32-bit floats for scenes to name; returns the name.
    pub(super) fn image(
        &mut self,
        name: &str,
        size: [u32; 2],
        value: &dyn Fn(u32) -> [f32; 3],
    ) -> Result<String> {
        let name = self.new_name(&format!("{name}.exr"));
        let count = size[0] * size[1];
        let channel = |k: usize, name: &str| Channel {
            name: name.to_owned(),
            data: (0..count).map(|i| value(i)[k]).collect(),
        };
        let window = Rect { min: (0, 0), max: (size[0] as i32, size[1] as i32) };
        let channels = ["R", "G", "B"].iter().enumerate().map(|(k, name)| channel(k, name)).collect();
        let picture = Picture { size, window, channels };
        write_exr(&self.folder()?.join(&name), &picture, &Header::default(), SaveOptions::default())?;
        Ok(name)
    }

    /// Keeps a scene for other renderers, where that was asked for.
    pub(super) fn offer(&mut self, case: &str, still: &Still, expected: f64) -> Result<()> {
        let Some(folder) = self.export.as_ref().filter(|_| !still.unshared) else { return Ok(()) };
        let name = format!("{}-{}.xml", self.id, self.offered.len());
        write(&folder.join(&name), still.xml().as_bytes())?;
        self.offered.push(json!({
            "id": self.id, "case": case, "file": name, "expected": expected, "samples": still.samples,
        }));
        Ok(())
    }

    /// Writes the list of what was offered.
    pub(super) fn finish(self) -> Result<()> {
        match self.export {
            Some(folder) if !self.offered.is_empty() => {
                let text = format!("{:#}\n", serde_json::Value::Array(self.offered));
                write(&folder.join(format!("{}.json", self.id)), text.as_bytes())
            }
            _ => Ok(()),
        }
    }

    /// Compiles a scene file in text.
    pub(super) fn build(&mut self, xml: &str) -> Result<Ready> {
        let folder = self.folder()?;
        let desc = load_str(xml, &folder, &LoadOptions::default())?;
        let scene =
            Scene::build(&desc, &BuildOptions { accel: self.accel.clone(), ..BuildOptions::default() })?;
        let integrator = Integrator::from_desc(&desc, &IntegratorOptions::default())?;
        Ok(Ready { scene, integrator })
    }

    /// Mean radiance of each of [`SEEDS`] renders.
    pub(super) fn means(&mut self, still: &Still) -> Result<Means> {
        self.means_with(still, Sequence::Sobol)
    }

    pub(super) fn means_with(&mut self, still: &Still, sequence: Sequence) -> Result<Means> {
        let ready = self.build(&still.xml())?;
        let samples = self.effort.count(still.samples);
        let mut means = Means { values: Vec::new(), dropped: None };
        for k in 0..SEEDS {
            let options = RenderOptions { sequence, ..options(samples, self.seed + k) };
            let rendered = ready.render(&options)?;
            if rendered.stats.bad.total() > 0 {
                means.dropped = Some(rendered.stats.bad.summary());
            }
            means.values.push(mean(&rendered.film.resolve()));
        }
        Ok(means)
    }

    /// The picture of one render with `samples` per pixel.
    pub(super) fn picture(&mut self, still: &Still, samples: u64) -> Result<Picture> {
        let seed = self.seed;
        Ok(self.build(&still.xml())?.render(&options(samples, seed))?.film.resolve())
    }
}

impl Ready {
    pub(super) fn render(&self, options: &RenderOptions) -> Result<Rendered> {
        render(&self.scene, &self.integrator, options, &Quiet)
    }
}

/// Options of a small render in one thread.
pub(super) fn options(samples_per_pixel: u64, seed: u64) -> RenderOptions {
    RenderOptions {
        samples_per_pixel,
        time: None,
        error: None,
        replicas: 0,
        seed,
        sequence: Sequence::Sobol,
        threads: 1,
        layers: LayerSet::default(),
        order: TileOrder::CentreOut,
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).map_err(|e| Error::new(format!("cannot write `{}`: {e}", path.display())))
}

/// Red, green and blue of every pixel, one after the other.
pub(super) fn rgb(picture: &Picture) -> Vec<f32> {
    ["R", "G", "B"].iter().filter_map(|name| picture.channel(name)).flatten().copied().collect()
}

/// Mean of all pixels and channels.
pub(super) fn mean(picture: &Picture) -> f64 {
    let values = rgb(picture);
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}
