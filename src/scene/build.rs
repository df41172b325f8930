//! From a scene description to a [`Scene`].

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::lamps::{Glow, Lamps};
use super::media::Media;
use super::shapes::GroupContents;
use super::{BuildOptions, LightSelection, NO_LIGHT, Plan, Scene, Traits};
use crate::accel::{Accel, Quality};
use crate::camera::{Camera, CameraMotion, FilmSize, camera_position, shutter};
use crate::desc::{Category, Error, ObjectId, Params, Result, SceneDesc};
use crate::film::FilmSpec;
use crate::light::{AreaEmission, AreaLight, Beam, Light, emitter_from_desc};
use crate::material::{Material, MaterialBuilder};
use crate::math::{DVec3, Ray, Vec2, Vec3};
use crate::medium::Medium;
use crate::shape::{Geometry, GeometryBuilder, ShapeId, ShapeSampler};
use crate::texture::{Pyramids, TextureFilter, Usage, texture_from_desc};

/// A light under construction: area lights need the finished geometry.
pub(super) enum Pending {
    Ready(Light),
    Area { shape: ShapeId, emission: AreaEmission, object: ObjectId, emitter: ObjectId },
}

pub(super) struct Builder<'a> {
    pub desc: &'a SceneDesc,
    pub recentre: DVec3,
    /// When the shutter opens and closes.
    pub shutter: [f64; 2],
    pub geometry: GeometryBuilder,
    pub material_builder: MaterialBuilder,
    materials: Vec<Arc<Material>>,
    pub material_of_shape: Vec<u32>,
    material_index: HashMap<*const Material, u32>,
    pub media: Media,
    /// Index of each medium that has been read.
    media_index: HashMap<ObjectId, u32>,
    pub pending: Vec<Pending>,
    /// Light of shapes in groups, and of curves.
    pub glows: Vec<Glow>,
    pub groups: HashMap<ObjectId, Arc<GroupContents>>,
    /// Shapes go into a group: its part of the geometry.
    pub in_group: Option<u32>,
    pub plan: Plan,
}

impl Scene {
    /// Compiles a scene description.
    ///
    /// # Errors
    /// Unknown plugins and parameters, values out of range and missing pieces,
    /// each with file, line and column.
    pub fn build(desc: &SceneDesc, options: &BuildOptions) -> Result<Scene> {
        let root = desc.params(desc.root);
        let sensor = one_sensor(&root)?;
        let (film, samples_per_pixel, file_sampler) = read_sensor(desc, sensor, options)?;
        let recentre = camera_position(desc, sensor)?;
        let shutter = shutter(desc, sensor)?;
        let camera_motion = CameraMotion::from_desc(desc, sensor, recentre)?;
        let film_size = FilmSize { width: film.size[0], height: film.size[1] };
        let camera = Camera::from_desc(desc, sensor, film_size, recentre)?;
        let mut builder = Builder {
            desc,
            recentre,
            shutter,
            geometry: GeometryBuilder::new(),
            material_builder: MaterialBuilder::default(),
            materials: Vec::new(),
            material_of_shape: Vec::new(),
            material_index: HashMap::new(),
            media: Media::default(),
            media_index: HashMap::new(),
            pending: Vec::new(),
            glows: Vec::new(),
            groups: HashMap::new(),
            in_group: None,
            plan: Plan {
                lens: camera.needs_lens(),
                camera_motion: camera_motion.is_some(),
                file_sampler,
                unread_images: desc.unread_images,
                ..Plan::default()
            },
        };
        // Definitions are checked even when nothing uses them.
        for (_, id) in root.children(Category::Bsdf) {
            builder.material_builder.build(desc, id)?;
        }
        for (_, id) in root.children(Category::Texture) {
            texture_from_desc(desc, id, Usage::Vector)?;
        }
        for (_, id) in root.children(Category::Emitter) {
            builder.emitter(id)?;
        }
        for (_, id) in root.children(Category::Medium) {
            builder.medium(id)?;
        }
        builder.media.camera = match desc.params(sensor).children(Category::Medium).as_slice() {
            [] => Medium::NONE,
            [(_, id)] => builder.medium(*id)?,
            [_, (_, second), ..] => {
                return Err(desc.error(desc.object(*second).pos, "a sensor stands in one medium only"));
            }
        };
        let shapes: Vec<ObjectId> = root.children(Category::Shape).iter().map(|(_, id)| *id).collect();
        builder.shapes(&shapes)?;
        root.children(Category::Integrator);
        root.children(Category::Sensor);
        root.finish()?;
        builder.finish((camera, camera_motion), film, samples_per_pixel, options)
    }
}

/// Width of a pixel in the middle of the film: where its ray begins, and how much it
/// grows per unit of distance. The shorter of its two sides.
fn pixel_of(camera: &Camera, size: FilmSize) -> [f32; 2] {
    let middle = Vec2::new(size.width as f32, size.height as f32) * 0.5;
    let lens = Vec2::splat(0.5);
    let [from, right, below] =
        [Vec2::ZERO, Vec2::X, Vec2::Y].map(|step| camera.ray(middle + step - Vec2::splat(0.5), lens, 0.0));
    let least =
        |of: fn(&Ray) -> Vec3| (of(&right) - of(&from)).length().min((of(&below) - of(&from)).length());
    [least(|ray| ray.origin), least(|ray| ray.dir)]
}

fn one_sensor(root: &Params) -> Result<ObjectId> {
    match root.children(Category::Sensor).as_slice() {
        [] => Err(root.error("the scene has no sensor").hint("add <sensor type=\"perspective\">")),
        // The first one, as Mitsuba does.
        [(_, first), ..] => Ok(*first),
    }
}

/// Film, samples per pixel and sampler name of a sensor.
fn read_sensor(
    desc: &SceneDesc,
    sensor: ObjectId,
    options: &BuildOptions,
) -> Result<(FilmSpec, u64, String)> {
    let params = desc.params(sensor);
    let mut film = match params.children(Category::Film).as_slice() {
        [] => FilmSpec::default(),
        [(_, id)] => FilmSpec::from_desc(desc, *id)?,
        [_, (_, second), ..] => {
            return Err(desc.error(desc.object(*second).pos, "a sensor has one film only"));
        }
    };
    film.override_window(options.size, options.crop)?;
    let (mut spp, mut name) = (4, "independent".to_owned());
    if let Some((_, id)) = params.children(Category::Sampler).first() {
        let sampler = desc.params(*id);
        let count = sampler.int("sample_count", 4)?;
        if count < 1 {
            return Err(
                sampler.error_at("sample_count", format!("`sample_count` must be at least 1, found {count}"))
            );
        }
        // Ours need no tuning and no seed from the file.
        for known in ["seed", "jitter", "strength"] {
            sampler.get(known);
        }
        name = desc.object(*id).plugin.clone();
        spp = count as u64;
        sampler.finish()?;
    }
    Ok((film, spp, name))
}

impl Builder<'_> {
    fn emitter(&mut self, id: ObjectId) -> Result<()> {
        let object = self.desc.object(id);
        if matches!(object.plugin.as_str(), "area" | "directionalarea") {
            let message = format!("emitter `{}` must stand inside a shape", object.plugin);
            return Err(self
                .desc
                .error(object.pos, message)
                .hint("`constant` lights the scene from everywhere"));
        }
        let light = emitter_from_desc(self.desc, id, self.recentre, self.shutter)?;
        if light.is_environment()
            && self.pending.iter().any(|p| matches!(p, Pending::Ready(l) if l.is_environment()))
        {
            return Err(self.desc.error(object.pos, "a scene has one environment only; this is the second"));
        }
        self.pending.push(Pending::Ready(light));
        Ok(())
    }

    pub(super) fn material_id(&mut self, material: Arc<Material>) -> u32 {
        let next = self.materials.len() as u32;
        let index = *self.material_index.entry(Arc::as_ptr(&material)).or_insert(next);
        if index == next {
            self.materials.push(material);
        }
        index
    }

    /// The index of a medium.
    fn medium(&mut self, id: ObjectId) -> Result<u32> {
        if let Some(index) = self.media_index.get(&id) {
            return Ok(*index);
        }
        let index = self.media.all.len() as u32;
        self.media.all.push(Medium::from_desc(self.desc, id)?);
        self.media_index.insert(id, index);
        Ok(index)
    }

    /// The media inside and outside of a shape; `None` when it bounds none.
    pub(super) fn sides(&mut self, params: &Params) -> Result<Option<[u32; 2]>> {
        let children = params.children(Category::Medium);
        let mut sides = [Medium::NONE; 2];
        for (name, id) in &children {
            let side = match *name {
                "interior" => 0,
                "exterior" => 1,
                other => {
                    let message = format!("a shape has a medium `interior` or `exterior`, found `{other}`");
                    return Err(self.desc.error(self.desc.object(*id).pos, message));
                }
            };
            sides[side] = self.medium(*id)?;
        }
        Ok((!children.is_empty()).then_some(sides))
    }

    fn finish(
        mut self,
        (camera, camera_motion): (Camera, Option<CameraMotion>),
        film: FilmSpec,
        spp: u64,
        options: &BuildOptions,
    ) -> Result<Scene> {
        let film_size = FilmSize { width: film.size[0], height: film.size[1] };
        let geometry = std::mem::take(&mut self.geometry).finish();
        let (name, quality) = (options.accel.as_deref(), options.bvh.as_deref());
        if let (Some(other), Some(_)) = (name.filter(|n| *n != "bvh8"), quality) {
            return Err(Error::new(format!("the accelerator `{other}` has no choice of quality"))
                .hint("--bvh goes with `bvh8`"));
        }
        let accel = Accel::build(name, Quality::named(quality)?, &geometry)?;
        let mut light_of_shape = vec![NO_LIGHT; geometry.shapes().len()];
        // An environment alone has no size to go by.
        let radius = Some(f64::from(accel.bounds().bounding_sphere().1)).filter(|r| *r > 0.0).unwrap_or(1.0);
        let mut lights = Vec::new();
        for pending in std::mem::take(&mut self.pending) {
            let (light, shape) = match pending {
                Pending::Ready(light) => (light, None),
                Pending::Area { shape, emission, object, emitter } => {
                    let Some(sampler) = ShapeSampler::new(&geometry, shape) else {
                        let pos = self.desc.object(object).pos;
                        return Err(self.desc.error(pos, "this area light has no area"));
                    };
                    if self.desc.object(emitter).plugin == "directionalarea" {
                        let beam = self.beam(&geometry, shape, emission, emitter)?;
                        lights.push(beam.into());
                        continue;
                    }
                    (Light::Area(AreaLight::new(&geometry, sampler, emission)), Some(shape))
                }
            };
            if light.power(radius) <= 0.0 {
                self.plan.black_lights += 1;
                continue;
            }
            if let Some(shape) = shape {
                light_of_shape[shape as usize] = lights.len() as u32;
            }
            lights.push(light);
        }
        // Positions of glowing shapes of groups, and of curves, go on from those of the lights.
        let glows = std::mem::take(&mut self.glows);
        let lamps = Lamps::new(&geometry, &glows, &mut lights);
        for (index, glow) in glows.iter().enumerate() {
            light_of_shape[glow.shape as usize] = (lights.len() + index) as u32;
        }
        self.plan.placed_lights = lamps.placed;
        self.plan.unsampled_lights = lamps.left;
        self.plan.glowing_curves = lamps.curves;
        self.plan.texture_bytes += lamps.bytes;
        let selection = LightSelection::new(&lights, &geometry, radius);
        self.plan.light_candidates = selection.most_candidates();
        self.plan.light_tree = selection.tree().map(|t| [t.leaf_count(), t.node_count(), t.memory_bytes()]);
        self.read_textures(options.texture_filter);
        let traits = |m: &Arc<Material>| Traits {
            tangents: m.needs_tangents(),
            two_sided: m.needs_both_sides(),
            attributes: m.needs_attributes(),
            filtered: m.is_filtered(),
            filtered_by_attribute: m.is_filtered_by_attribute(),
            null: m.has_null(),
            disperses: m.disperses(),
        };
        let traits = self.materials.iter().map(traits).collect();
        let environment = lights.iter().position(Light::is_environment).map(|i| i as u32);
        self.plan.media = self.media.all.len();
        self.finish_plan(&geometry, &accel, &lights, environment.is_some());
        self.material_of_shape.resize(geometry.shapes().len(), 0);
        let pixel = if self.plan.pyramid_bytes > 0 { pixel_of(&camera, film_size) } else { [0.0; 2] };
        Ok(Scene {
            geometry,
            accel,
            camera,
            camera_motion,
            film,
            samples_per_pixel: spp,
            lights,
            lamps,
            media: self.media,
            selection,
            environment,
            pixel,
            plan: self.plan,
            recentre: self.recentre,
            materials: self.materials,
            material_of_shape: self.material_of_shape,
            light_of_shape,
            traits,
        })
    }

    /// A light that shines along the normal of a flat shape.
    fn beam(
        &self,
        geometry: &Geometry,
        shape: ShapeId,
        emission: AreaEmission,
        emitter: ObjectId,
    ) -> Result<Beam> {
        let prim = geometry.shapes()[shape as usize].first_prim;
        match geometry.analytic(prim).filter(|a| a.is_planar()) {
            Some(flat) => Ok(Beam { prim, normal: flat.normal(), area: flat.area(), emission }),
            None => Err(self
                .desc
                .error(self.desc.object(emitter).pos, "`directionalarea` needs a flat shape")
                .hint("`rectangle` and `disk` are flat")),
        }
    }

    /// Prepares the textures of all materials, and counts each image once.
    fn read_textures(&mut self, filter: TextureFilter) {
        let mut pyramids = Pyramids::default();
        let mut seen = HashSet::new();
        for material in &self.materials {
            self.plan.texture_bytes += material.table_bytes();
            material.visit_textures(&mut |texture| {
                texture.visit_bitmaps(&mut |bitmap| {
                    if filter == TextureFilter::Footprint {
                        bitmap.filter(&mut pyramids);
                    }
                    if seen.insert(bitmap.image()) {
                        self.plan.texture_bytes += bitmap.memory_bytes();
                    }
                });
            });
        }
        self.plan.pyramid_bytes = pyramids.memory_bytes();
    }

    fn finish_plan(&mut self, geometry: &Geometry, accel: &Accel, lights: &[Light], environment: bool) {
        let plan = &mut self.plan;
        plan.triangles = geometry.triangle_count() as usize;
        plan.analytic = geometry.analytic_count() as usize;
        plan.deforming = geometry.moving_count() as usize;
        plan.curves = geometry.curve_count() as usize;
        plan.groups = geometry.parts() as usize - 1;
        plan.attributes = geometry.attribute_count();
        plan.moving_instances = geometry.instances().iter().filter(|i| i.moves()).count();
        plan.moving_lights = lights.iter().filter(|l| l.moves()).count();
        plan.motion = geometry.moves() || plan.camera_motion || plan.moving_lights > 0;
        plan.materials = self.materials.len();
        for material in &self.materials {
            plan.bsdfs.extend(material.kinds());
        }
        plan.bsdfs.sort_unstable();
        plan.bsdfs.dedup();
        plan.lights = lights.len();
        plan.light_kinds = lights.iter().map(Light::name).collect();
        plan.light_kinds.sort_unstable();
        plan.light_kinds.dedup();
        plan.environment = environment;
        plan.delta_lights_only = lights.iter().all(Light::is_delta);
        plan.dispersion = self.materials.iter().any(|m| m.disperses());
        plan.alpha = self.materials.iter().any(|m| m.has_null());
        plan.tangents = self.materials.iter().any(|m| m.needs_tangents());
        plan.lobe_choice = self.materials.iter().any(|m| m.chooses());
        plan.smooth_surfaces = self.materials.iter().any(|m| !m.is_delta_only());
        plan.geometry_bytes = geometry.memory_bytes();
        plan.accel_bytes = accel.memory_bytes();
        plan.texture_bytes += lights.iter().map(Light::memory_bytes).sum::<usize>();
        plan.accel = accel.name();
    }
}
