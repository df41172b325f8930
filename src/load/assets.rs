//! The files that objects name: found, decoded once each and in parallel, and
//! attached to the objects.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::parse::Parsed;
use super::{LoadOptions, curves, files, image_file, lenient, measured, obj, ply, serialized};
use crate::desc::{
    Category, Curves, Image, MeasuredData, Mesh, ObjectId, Param, Params, Pixels, Pos, Result, SceneDesc,
    Value,
};

/// A mesh file's format and the parameters that change how it is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MeshRequest {
    /// Wavefront OBJ.
    Obj { flip_tex_coords: bool },
    /// Stanford PLY.
    Ply { flip_tex_coords: bool },
    /// Mitsuba 0.x binary meshes.
    Serialized { shape_index: u32 },
}

impl MeshRequest {
    /// Reads the file; gives warnings too.
    pub fn read(self, path: &Path) -> Result<(Mesh, Vec<String>)> {
        match self {
            MeshRequest::Obj { flip_tex_coords } => Ok((obj::read(path, flip_tex_coords)?, Vec::new())),
            MeshRequest::Ply { flip_tex_coords } => Ok((ply::read(path, flip_tex_coords)?, Vec::new())),
            MeshRequest::Serialized { shape_index } => serialized::read(path, shape_index),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Request {
    Mesh(MeshRequest),
    Image,
    /// An image that nothing shows: a texel stands for it.
    Unshown,
    /// With that many points or more each.
    Curves {
        least: usize,
    },
    Measured,
}

enum Decoded {
    Mesh(Mesh),
    Image(Image),
    Curves(Curves),
    Measured(MeasuredData),
}

/// One file to decode, and who asked first.
struct Job {
    request: Request,
    path: PathBuf,
    pos: Pos,
}

/// Decodes all files and attaches them.
pub fn decode(parsed: &mut Parsed, options: &LoadOptions) -> Result<()> {
    let mut jobs: Vec<Job> = Vec::new();
    let mut known: HashMap<(PathBuf, Request), usize> = HashMap::new();
    let mut users: Vec<(ObjectId, usize, Pos)> = Vec::new();
    let shown = shown(&parsed.scene);
    for id in 0..parsed.scene.objects.len() as ObjectId {
        let job = match job_of(parsed, id) {
            Ok(Some(job)) if job.request == Request::Image && !shown[id as usize] => {
                Job { request: Request::Unshown, ..job }
            }
            Ok(Some(job)) => job,
            Ok(None) => continue,
            Err(error) => {
                lenient::without_file(&mut parsed.scene, id, error)?;
                continue;
            }
        };
        let (key, pos) = ((files::canonical(&job.path), job.request), job.pos);
        let index = *known.entry(key).or_insert(jobs.len());
        if index == jobs.len() {
            jobs.push(job);
        }
        users.push((id, index, pos));
    }

    parsed.scene.unread_images = jobs.iter().filter(|job| job.request == Request::Unshown).count();
    let results: Vec<_> = jobs.par_iter().map(|job| run(job, options)).collect();
    let mut values = Vec::with_capacity(jobs.len());
    for (job, result) in jobs.iter().zip(results) {
        let file = parsed.scene.files[job.pos.file as usize].clone();
        values.push(result.map_err(|e| e.at(file, job.pos)).map(|(decoded, warnings)| {
            parsed.scene.warnings.extend(warnings);
            keep(&mut parsed.scene, decoded)
        }));
    }

    for (id, index, pos) in users {
        let value = match &values[index] {
            Ok(value) => value.clone(),
            Err(error) => {
                lenient::without_file(&mut parsed.scene, id, error.clone())?;
                continue;
            }
        };
        let params = &mut parsed.scene.objects[id as usize].params;
        let name = match value {
            Value::Mesh(_) => {
                params.retain(|p| !["filename", "flip_tex_coords", "shape_index"].contains(&p.name.as_str()));
                "mesh"
            }
            Value::Curves(_) => {
                params.retain(|p| p.name != "filename");
                "curves"
            }
            Value::Measured(_) => "measured",
            _ => "image",
        };
        params.push(Param { name: name.into(), value, pos });
    }
    Ok(())
}

/// Which objects some shape, light, camera or integrator has to do with: materials and
/// textures that only stand in the file are not among them. All, where there is nothing to
/// see.
fn shown(scene: &SceneDesc) -> Vec<bool> {
    let objects = |id: ObjectId| {
        scene
            .object(id)
            .params
            .iter()
            .filter_map(|p| if let Value::Object(id) = p.value { Some(id) } else { None })
    };
    let of = |id: &ObjectId, categories: &[Category]| categories.contains(&scene.object(*id).category);
    if !objects(scene.root).any(|id| of(&id, &[Category::Shape, Category::Emitter])) {
        return vec![true; scene.objects.len()];
    }
    let mut shown = vec![false; scene.objects.len()];
    let mut stack: Vec<ObjectId> =
        objects(scene.root).filter(|id| !of(id, &[Category::Bsdf, Category::Texture])).collect();
    while let Some(id) = stack.pop() {
        if !std::mem::replace(&mut shown[id as usize], true) {
            stack.extend(objects(id));
        }
    }
    shown
}

/// Puts what was decoded into the scene.
fn keep(scene: &mut SceneDesc, decoded: Decoded) -> Value {
    match decoded {
        Decoded::Mesh(mesh) => {
            scene.meshes.push(Arc::new(mesh));
            Value::Mesh(scene.meshes.len() as u32 - 1)
        }
        Decoded::Image(image) => {
            scene.images.push(Arc::new(image));
            Value::Image(scene.images.len() as u32 - 1)
        }
        Decoded::Curves(curves) => {
            scene.curves.push(Arc::new(curves));
            Value::Curves(scene.curves.len() as u32 - 1)
        }
        Decoded::Measured(data) => {
            scene.measured.push(Arc::new(data));
            Value::Measured(scene.measured.len() as u32 - 1)
        }
    }
}

fn run(job: &Job, options: &LoadOptions) -> Result<(Decoded, Vec<String>)> {
    match job.request {
        Request::Mesh(request) => {
            let (mesh, warnings) = request.read(&job.path)?;
            Ok((Decoded::Mesh(mesh), warnings))
        }
        Request::Image => {
            let name = job.path.display().to_string();
            let image = image_file::read(&job.path, &name, options.max_image_bytes)?;
            Ok((Decoded::Image(image), Vec::new()))
        }
        Request::Unshown => {
            let (name, pixels) = (job.path.display().to_string(), Pixels::U8(vec![128, 128, 128, 255]));
            Ok((Decoded::Image(Image { width: 1, height: 1, channels: 4, pixels, name }), Vec::new()))
        }
        Request::Measured => {
            let (data, warnings) = measured::read(&job.path)?;
            Ok((Decoded::Measured(data), warnings))
        }
        Request::Curves { least } => Ok((Decoded::Curves(curves::read(&job.path, least)?), Vec::new())),
    }
}

/// The file that an object needs decoded, if it is of a kind that does.
fn job_of(parsed: &Parsed, id: ObjectId) -> Result<Option<Job>> {
    let params = Params::new(&parsed.scene, id);
    let object = params.object();
    let request = match (object.category, object.plugin.as_str()) {
        (Category::Shape, "obj") => {
            Request::Mesh(MeshRequest::Obj { flip_tex_coords: params.bool("flip_tex_coords", true)? })
        }
        (Category::Shape, "ply") => {
            Request::Mesh(MeshRequest::Ply { flip_tex_coords: params.bool("flip_tex_coords", false)? })
        }
        (Category::Shape, "serialized") => {
            let index = params.int("shape_index", 0)?;
            let shape_index = u32::try_from(index).map_err(|_| {
                params.error_at("shape_index", format!("`shape_index` must not be negative, found {index}"))
            })?;
            Request::Mesh(MeshRequest::Serialized { shape_index })
        }
        (Category::Shape, "linearcurve") => Request::Curves { least: 2 },
        (Category::Shape, "bsplinecurve") => Request::Curves { least: 4 },
        (Category::Texture, "bitmap") | (Category::Emitter, "envmap") => Request::Image,
        (Category::Bsdf, "measured") => Request::Measured,
        _ => return Ok(None),
    };
    let Some(name) = params.string_opt("filename")? else {
        let what = format!("{} `{}` needs a `filename`", object.category.tag(), object.plugin);
        return Err(params.error(what));
    };
    let pos = params.position("filename");
    let path = files::find(name, &parsed.search[pos.file as usize])
        .map_err(|e| e.at(parsed.scene.files[pos.file as usize].clone(), pos))?;
    Ok(Some(Job { request, path, pos }))
}
