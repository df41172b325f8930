//! Shapes of a scene file: those that stand still at the top, groups, and the
//! instances that place groups. Whatever moves becomes a group of its own with
//! an instance that moves.

use std::sync::Arc;

use super::build::{Builder, Pending};
use super::lamps::Glow;
use crate::desc::{Category, Error, ObjectId, Params, Result};
use crate::light::{AreaEmission, area_emission_from_desc};
use crate::material::Material;
use crate::math::{DMat3, DVec3, Motion, Transform};
use crate::shape::{CurveKind, MeshOptions, ShapeId};

/// Scene-file names of all shapes.
pub const SHAPES: &[&str] = &[
    "obj",
    "ply",
    "serialized",
    "mesh",
    "rectangle",
    "cube",
    "sphere",
    "disk",
    "cylinder",
    "linearcurve",
    "bsplinecurve",
    "shapegroup",
    "instance",
];

/// Most instances of a scene, nested ones multiplied out.
const MAX_INSTANCES: usize = 1 << 28;
/// Those that a short file may amount to, and those for each of its objects
/// when that is more: groups in groups multiply, and a few lines could ask for
/// any number.
const FREE_INSTANCES: usize = 1 << 20;
const INSTANCES_PER_OBJECT: usize = 1024;

/// What a group holds.
#[derive(Clone, Debug)]
pub(super) struct GroupContents {
    /// Its own shapes, as a part of the geometry.
    part: Option<u32>,
    /// Other groups in it, and where they are.
    nested: Vec<(Arc<GroupContents>, Motion)>,
    /// Instances that one of it amounts to.
    instances: usize,
}

impl GroupContents {
    fn new(part: Option<u32>, nested: Vec<(Arc<GroupContents>, Motion)>) -> GroupContents {
        let below = nested.iter().fold(0, |sum: usize, (inner, _)| sum.saturating_add(inner.instances));
        GroupContents { instances: below.saturating_add(usize::from(part.is_some())), part, nested }
    }
}

/// Shapes of one list, by how they are built.
#[derive(Default)]
struct Sorted {
    still: Vec<ObjectId>,
    moving: Vec<ObjectId>,
    instances: Vec<ObjectId>,
    groups: Vec<ObjectId>,
}

impl Builder<'_> {
    /// Builds all shapes of the scene: still ones first, as the geometry wants
    /// them, then groups and their instances.
    pub(super) fn shapes(&mut self, ids: &[ObjectId]) -> Result<()> {
        let sorted = self.sort(ids)?;
        let to_scene = Transform::translate(-self.recentre);
        for id in sorted.still {
            self.shape(id, Some(&to_scene))?;
        }
        // Definitions are checked even when nothing uses them.
        for id in sorted.groups {
            self.group(id)?;
        }
        let mut placed = Vec::new();
        for id in sorted.moving {
            placed.push(self.moving_shape(id)?);
        }
        for id in sorted.instances {
            placed.push(self.instance(id)?);
        }
        self.check_instances(placed.iter().map(|(contents, _)| contents.instances))?;
        for (contents, motion) in placed {
            self.place(&contents, &motion.map(|m| to_scene.after(m)));
        }
        Ok(())
    }

    fn sort(&self, ids: &[ObjectId]) -> Result<Sorted> {
        let mut sorted = Sorted::default();
        for &id in ids {
            match self.desc.object(id).plugin.as_str() {
                "shapegroup" => sorted.groups.push(id),
                "instance" => sorted.instances.push(id),
                _ if self.moves(id)? => sorted.moving.push(id),
                _ => sorted.still.push(id),
            }
        }
        Ok(sorted)
    }

    /// The `to_world` of an object while the shutter is open.
    fn motion(&self, params: &Params) -> Result<Motion> {
        let [open, close] = self.shutter;
        Ok(params.motion("to_world")?.during(open, close))
    }

    fn moves(&self, id: ObjectId) -> Result<bool> {
        let params = self.desc.params(id);
        let [open, close] = self.shutter;
        let deforms = params.mesh().is_some_and(|mesh| mesh.deformation.len() > 1) && close > open;
        Ok(deforms || self.motion(&params)?.as_still().is_none())
    }

    /// A shape that moves or deforms, as a group, and its motion.
    fn moving_shape(&mut self, id: ObjectId) -> Result<(Arc<GroupContents>, Motion)> {
        let params = self.desc.params(id);
        let motion = self.motion(&params)?;
        if curve_kind(&self.desc.object(id).plugin).is_some() && !is_rigid(&motion) {
            let message = "a curve that moves cannot be scaled by `to_world`: its radii stay what they are";
            return Err(params
                .error_at("to_world", message)
                .hint("put the curve into a `shapegroup` and move an `instance` of it"));
        }
        let part = self.geometry.begin_group();
        self.in_group = Some(part);
        self.shape(id, None)?;
        self.in_group = None;
        Ok((Arc::new(GroupContents::new(Some(part), Vec::new())), motion))
    }

    /// The contents of a `shapegroup`, built once.
    fn group(&mut self, id: ObjectId) -> Result<Arc<GroupContents>> {
        if let Some(contents) = self.groups.get(&id) {
            return Ok(contents.clone());
        }
        let params = self.desc.params(id);
        let ids: Vec<ObjectId> = params.children(Category::Shape).iter().map(|(_, id)| *id).collect();
        params.finish()?;
        self.plan.shapes += 1;
        let sorted = self.sort(&ids)?;
        if let Some(inner) = sorted.groups.first() {
            return Err(self
                .desc
                .error(self.desc.object(*inner).pos, "a `shapegroup` cannot stand in another")
                .hint("put an `instance` of it there"));
        }
        let (mut part, mut nested) = (None, Vec::new());
        for id in sorted.moving {
            nested.push(self.moving_shape(id)?);
        }
        for id in sorted.instances {
            let inner = self.instance(id)?;
            // Each that is kept leads to primitives, so that placing them ends.
            if inner.0.instances > 0 {
                nested.push(inner);
            }
        }
        if !sorted.still.is_empty() {
            part = Some(self.geometry.begin_group());
            self.in_group = part;
            for id in sorted.still {
                self.shape(id, Some(&Transform::IDENTITY))?;
            }
            self.in_group = None;
        }
        let contents = Arc::new(GroupContents::new(part, nested));
        self.groups.insert(id, contents.clone());
        Ok(contents)
    }

    /// What an `instance` places, and where.
    fn instance(&mut self, id: ObjectId) -> Result<(Arc<GroupContents>, Motion)> {
        let params = self.desc.params(id);
        let motion = self.motion(&params)?;
        let shapes = params.children(Category::Shape);
        params.finish()?;
        let group = match shapes.as_slice() {
            [(_, group)] if self.desc.object(*group).plugin == "shapegroup" => *group,
            [(_, other)] => {
                let name = &self.desc.object(*other).plugin;
                let message = format!("an `instance` places a `shapegroup`, found `{name}`");
                return Err(params_error(self, id, &message).hint("put the shape into a `shapegroup`"));
            }
            found => {
                let message = format!("an `instance` needs one `shapegroup`, found {} shapes", found.len());
                return Err(params_error(self, id, &message));
            }
        };
        self.plan.shapes += 1;
        Ok((self.group(group)?, motion))
    }

    /// Refuses groups in groups that multiply to more instances than a file of
    /// this size can mean.
    fn check_instances(&self, placed: impl Iterator<Item = usize>) -> Result<()> {
        let by_size = self.desc.objects.len().saturating_mul(INSTANCES_PER_OBJECT);
        let most = by_size.clamp(FREE_INSTANCES, MAX_INSTANCES);
        if placed.fold(0, usize::saturating_add) > most {
            let message = format!("groups in groups multiply to more than {most} instances");
            return Err(self.desc.params(self.desc.root).error(message));
        }
        Ok(())
    }

    /// Adds the instances that a placed group amounts to.
    fn place(&mut self, contents: &GroupContents, motion: &Motion) {
        if let Some(part) = contents.part {
            self.plan.instances += 1;
            self.geometry.add_instance(part, motion.clone());
        }
        for (inner, inner_motion) in &contents.nested {
            self.place(inner, &motion.after(inner_motion));
        }
    }

    /// Adds a shape with its material and its light. `space` goes after its
    /// `to_world`; without one that is left to an instance.
    fn shape(&mut self, id: ObjectId, space: Option<&Transform>) -> Result<()> {
        let desc = self.desc;
        let params = desc.params(id);
        let emitters = params.children(Category::Emitter);
        let bsdfs = params.children(Category::Bsdf);
        let sides = self.sides(&params)?;
        if let [_, (_, second), ..] = bsdfs.as_slice() {
            return Err(desc.error(desc.object(*second).pos, "a shape has one bsdf only"));
        }
        let material = match bsdfs.first() {
            Some((_, bsdf)) => self.material_builder.build(desc, *bsdf)?,
            None => Arc::new(Material::default_for(!emitters.is_empty())),
        };
        let emission = match emitters.as_slice() {
            [] => None,
            [(_, emitter)] => Some(area_emission_from_desc(desc, *emitter)?),
            [_, (_, second), ..] => {
                return Err(desc.error(desc.object(*second).pos, "a shape has one emitter only"));
            }
        };
        let to_space = match space {
            None => {
                params.get("to_world");
                Transform::IDENTITY
            }
            Some(space) => match self.motion(&params)?.as_still() {
                Some(still) => space.after(&still),
                None => return Err(params.error_at("to_world", "this shape cannot move")),
            },
        };
        let shape = self.primitives(&params, &to_space, &material, emission.as_ref())?;
        params.finish()?;
        let Some(shape) = shape else { return Ok(()) };
        let index = self.material_id(material);
        let slot = shape as usize;
        if self.material_of_shape.len() <= slot {
            self.material_of_shape.resize(slot + 1, 0);
        }
        self.material_of_shape[slot] = index;
        if sides.is_some() {
            let count = self.media.of_shape.len().max(slot + 1);
            self.media.of_shape.resize(count, None);
            self.media.of_shape[slot] = sides;
        }
        let is_curve = curve_kind(&desc.object(id).plugin).is_some();
        match emission {
            None => {}
            Some(_) if is_curve && desc.object(emitters[0].1).plugin == "directionalarea" => {
                let pos = desc.object(emitters[0].1).pos;
                return Err(desc
                    .error(pos, "`directionalarea` needs a flat shape")
                    .hint("`rectangle` and `disk` are flat"));
            }
            Some(_) if self.in_group.is_some() && desc.object(emitters[0].1).plugin == "directionalarea" => {
                let pos = desc.object(emitters[0].1).pos;
                return Err(desc.error(pos, "`directionalarea` can neither move nor be instanced"));
            }
            Some(emission) => match self.in_group {
                Some(part) => self.glows.push(Glow { shape, part, emission }),
                // Not sampled, so that it needs no light.
                None if is_curve => self.glows.push(Glow { shape, part: 0, emission }),
                None => {
                    let emitter = emitters[0].1;
                    self.pending.push(Pending::Area { shape, emission, object: id, emitter });
                }
            },
        }
        Ok(())
    }

    /// Adds the primitives of a shape; `None` when it has none.
    fn primitives(
        &mut self,
        params: &Params,
        to_space: &Transform,
        material: &Material,
        emission: Option<&AreaEmission>,
    ) -> Result<Option<ShapeId>> {
        let object = params.object();
        if let Some(kind) = curve_kind(&object.plugin) {
            return self.curves(kind, params, to_space);
        }
        let flip = params.bool("flip_normals", false)?;
        let shutter = self.shutter;
        let textured_light = emission.is_some_and(|e| e.radiance.is_constant().is_none());
        let attributes = material.needs_attributes() || emission.is_some_and(|e| !e.tints.is_empty());
        let options = |face_normals| MeshOptions {
            flip_normals: flip,
            face_normals,
            keep_uvs: material.needs_uv() || material.needs_tangents() || textured_light,
            keep_tangents: material.needs_tangents(),
            shutter,
        };
        let at = |e: Error| if e.location.is_some() { e } else { params.error(e.message) };
        self.plan.shapes += 1;
        let shape = match object.plugin.as_str() {
            "obj" | "ply" | "serialized" | "mesh" => {
                let options = options(params.bool("face_normals", false)?);
                let mesh = params
                    .mesh()
                    .ok_or_else(|| params.error(format!("shape `{}` needs a `filename`", object.plugin)))?;
                return self.mesh(mesh, to_space, options, attributes).map_err(at);
            }
            "cube" => {
                let options = options(params.bool("face_normals", false)?);
                return self.geometry.add_cube(to_space, options).map(|(s, _)| Some(s)).map_err(at);
            }
            "rectangle" => self.geometry.add_rectangle(to_space, flip),
            "disk" => self.geometry.add_disk(to_space, flip),
            "sphere" => {
                let centre = params.vector_opt("center")?.unwrap_or(DVec3::ZERO);
                let radius = params.float("radius", 1.0)?;
                self.geometry.add_sphere(centre, radius, to_space, flip)
            }
            "cylinder" => {
                let p0 = params.vector_opt("p0")?.unwrap_or(DVec3::ZERO);
                let p1 = params.vector_opt("p1")?.unwrap_or(DVec3::Z);
                let radius = params.float("radius", 1.0)?;
                self.geometry.add_cylinder([p0, p1], radius, to_space, flip)
            }
            name => {
                return Err(params
                    .error(format!("unknown shape `{name}`"))
                    .suggest(name, SHAPES.iter().copied()));
            }
        };
        shape.map(Some).map_err(at)
    }

    /// Adds a shape of curves.
    fn curves(&mut self, kind: CurveKind, params: &Params, to_space: &Transform) -> Result<Option<ShapeId>> {
        let curves = params
            .curves()
            .ok_or_else(|| params.error(format!("shape `{}` needs a `filename`", kind.name())))?;
        self.plan.shapes += 1;
        self.geometry.add_curves(kind, curves, to_space).map(Some).map_err(|e| params.error(e.message))
    }

    fn mesh(
        &mut self,
        mesh: &crate::desc::Mesh,
        to_space: &Transform,
        options: MeshOptions,
        with_attributes: bool,
    ) -> Result<Option<ShapeId>> {
        let keep_uvs = options.keep_uvs;
        let names = if with_attributes { self.desc.attribute_names() } else { &[] };
        if mesh.triangles.is_empty() {
            return Ok(None);
        }
        let (shape, report) = self.geometry.add_mesh_with(mesh, to_space, options, names)?;
        self.plan.dropped_triangles += report.dropped;
        self.plan.normal_meshes[usize::from(mesh.normals.is_empty())] += 1;
        if !mesh.uvs.is_empty() {
            self.plan.uv_meshes[usize::from(!keep_uvs)] += 1;
            if !keep_uvs {
                self.plan.saved_bytes += mesh.uvs.len() * size_of::<crate::math::Vec2>();
            }
        }
        Ok(Some(shape))
    }
}

/// The kind of curve that a shape is, by its name in scene files.
fn curve_kind(plugin: &str) -> Option<CurveKind> {
    [CurveKind::Linear, CurveKind::BSpline].into_iter().find(|kind| kind.name() == plugin)
}

/// True when nothing is scaled on the way, up to the rounding of a file.
fn is_rigid(motion: &Motion) -> bool {
    motion.times().all(|time| {
        let m = DMat3::from_mat4(motion.at(time).matrix);
        (m.transpose() * m).abs_diff_eq(DMat3::IDENTITY, 1e-4)
    })
}

fn params_error(builder: &Builder, id: ObjectId, message: &str) -> Error {
    builder.desc.error(builder.desc.object(id).pos, message)
}
