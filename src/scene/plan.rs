//! What a scene needs, and what was left out of it.

use std::fmt;

use serde_json::{Value, json};

/// The facts of a scene and what follows from them. Printed by `etendue
/// explain`, written to the EXR header and to the statistics.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// Primitives.
    pub triangles: usize,
    /// Spheres, disks, cylinders and rectangles.
    pub analytic: usize,
    /// Triangles that deform while the shutter is open.
    pub deforming: usize,
    /// Segments of curves, and parts of segments.
    pub curves: usize,
    /// Groups of shapes.
    pub groups: usize,
    /// Instances of groups, nested ones multiplied out.
    pub instances: usize,
    /// Instances that move while the shutter is open.
    pub moving_instances: usize,
    /// The camera moves while the shutter is open.
    pub camera_motion: bool,
    /// Lights without a surface that move.
    pub moving_lights: usize,
    /// Anything moves while the shutter is open.
    pub motion: bool,
    /// Lights of instanced or moving shapes that are sampled: part of `lights`.
    pub placed_lights: usize,
    /// Lights that are curves, deform or are too many, which scattered rays alone find.
    pub unsampled_lights: usize,
    /// Those of them that are curves.
    pub glowing_curves: usize,
    /// Attributes of meshes that are kept.
    pub attributes: usize,
    /// Some material refracts colours apart.
    pub dispersion: bool,
    /// Media, each of which absorbs.
    pub media: usize,
    /// Triangles dropped because they have no area.
    pub dropped_triangles: usize,
    /// Shapes in the file.
    pub shapes: usize,
    /// Distinct materials that some shape uses.
    pub materials: usize,
    /// Scene-file names of the bsdfs in use, sorted.
    pub bsdfs: Vec<&'static str>,
    /// Lights that can be sampled.
    pub lights: usize,
    /// Lights of no power, left out.
    pub black_lights: usize,
    /// Names of the light kinds in use, sorted.
    pub light_kinds: Vec<&'static str>,
    /// Leaves, nodes and bytes of the light tree, if there is one.
    pub light_tree: Option<[usize; 3]>,
    /// Lights, or parts of lights, that are sampled at a vertex at most; one of
    /// them gets a shadow ray.
    pub light_candidates: usize,
    /// There is an environment.
    pub environment: bool,
    /// All lights are deltas: scattered rays never find one.
    pub delta_lights_only: bool,
    /// The camera has a lens of some size.
    pub lens: bool,
    /// Some light passes straight through some surface (mask, null).
    pub alpha: bool,
    /// Some surface can be connected to a light; otherwise shadow rays are left out.
    pub smooth_surfaces: bool,
    /// Some material looks at the direction of the tangent.
    pub tangents: bool,
    /// Some material chooses between lobes.
    pub lobe_choice: bool,
    /// Meshes whose texture coordinates are kept, and whose were dropped.
    pub uv_meshes: [usize; 2],
    /// Meshes whose vertex normals are kept, and those without.
    pub normal_meshes: [usize; 2],
    /// Bytes of geometry.
    pub geometry_bytes: usize,
    /// Bytes of texture coordinates that were not kept.
    pub saved_bytes: usize,
    /// Bytes of the accelerator.
    pub accel_bytes: usize,
    /// Bytes of textures and of tables of materials.
    pub texture_bytes: usize,
    /// Images that nothing shows, which were not read.
    pub unread_images: usize,
    /// Bytes of their averages over footprints; 0 when none are kept.
    pub pyramid_bytes: usize,
    /// Name of the accelerator.
    pub accel: &'static str,
    /// What the file calls its sampler; the sequence is ours.
    pub file_sampler: String,
}

impl Plan {
    /// Random dimensions of one path: (before the first vertex, per vertex).
    #[must_use]
    pub fn dimensions(&self) -> (u32, u32) {
        let before = 2 + if self.lens { 2 } else { 0 } + u32::from(self.motion);
        let light = if self.smooth_surfaces && self.lights > 0 {
            2 + u32::from(self.lights > 1 || self.light_tree.is_some())
        } else {
            0
        };
        // A direction and the roulette; a lobe where there is a choice.
        (before, light + 2 + 1 + u32::from(self.lobe_choice))
    }

    /// One line for the file header: what there is.
    #[must_use]
    pub fn summary(&self) -> String {
        let media = if self.media > 0 { format!("; media {}", self.media) } else { String::new() };
        format!(
            "accel {}; {} triangles, {} analytic; lights {} ({}); bsdfs {}; lens {}; alpha {}; instances {}; motion {}{media}",
            self.accel,
            self.triangles,
            self.analytic,
            self.lights,
            join(&self.light_kinds),
            join(&self.bsdfs),
            yes(self.lens),
            yes(self.alpha),
            self.instances,
            self.moving_parts(),
        )
    }

    /// What was left out, one reason each.
    #[must_use]
    pub fn left_out(&self) -> Vec<String> {
        let mut out = Vec::new();
        let mut leave = |condition: bool, text: String| {
            if condition {
                out.push(text);
            }
        };
        leave(!self.motion, "motion: nothing moves; no keys, no time dimension".into());
        leave(self.instances == 0, "instances: none; one tree, no second level".into());
        leave(!self.lens, "lens: a point aperture; 2 dimensions saved".into());
        leave(
            self.lights <= 1 && self.light_tree.is_none(),
            "light choice: at most one light; 1 dimension a vertex saved".into(),
        );
        leave(
            self.lights > 0 && self.light_tree.is_none(),
            format!(
                "light tree: {} only; {}",
                if self.lights == 1 { "1 light".to_owned() } else { format!("{} lights", self.lights) },
                if self.light_candidates == self.lights {
                    "each is a candidate at every vertex"
                } else {
                    "they are chosen by power, whatever the receiver"
                }
            ),
        );
        leave(
            !self.lobe_choice,
            "lobe choice: every material has one lobe; 1 dimension a vertex saved".into(),
        );
        leave(!self.tangents, "tangents: no material is anisotropic or bumped".into());
        leave(self.lights == 0, "light sampling: there is no light to sample".into());
        leave(!self.smooth_surfaces, "shadow rays: every surface is a mirror or smooth glass".into());
        leave(
            self.delta_lights_only && self.lights > 0,
            "light hits: no light has an area; MIS is not needed".into(),
        );
        leave(!self.environment, "environment: none; a ray that leaves is black".into());
        leave(!self.alpha, "alpha: nothing is see-through".into());
        leave(
            self.uv_meshes[1] > 0,
            format!(
                "texture coordinates: no texture reads them on {} of {} meshes; {} saved",
                self.uv_meshes[1],
                self.uv_meshes[0] + self.uv_meshes[1],
                bytes(self.saved_bytes)
            ),
        );
        leave(self.unread_images > 0, format!("images: {} that nothing shows; not read", self.unread_images));
        leave(self.black_lights > 0, format!("lights: {} without power", self.black_lights));
        leave(self.dropped_triangles > 0, format!("triangles: {} without area", self.dropped_triangles));
        leave(self.attributes == 0, "mesh attributes: no texture reads any".into());
        leave(
            self.placed_lights == 0 && self.unsampled_lights == 0,
            "placed lamps: no lamp is in an instance or a shape that moves".into(),
        );
        leave(!self.dispersion, "dispersion: none; no path has a wavelength".into());
        leave(
            self.pyramid_bytes == 0,
            "texture filter: no image is averaged ahead of time; samples are points".into(),
        );
        leave(self.media == 0, "media: none; no transmittance is tracked".into());
        out
    }
}

impl Plan {
    /// What is said of lights that are not sampled, if there are any.
    #[must_use]
    pub fn unsampled(&self) -> Option<String> {
        let curves = self.glowing_curves;
        let others = self.unsampled_lights - curves;
        let mut parts = Vec::new();
        if curves > 0 {
            parts.push(format!("{curves} more made of curves"));
        }
        if others > 0 {
            parts.push(format!("{others} more deform or are too many instances to sample"));
        }
        (!parts.is_empty()).then(|| format!("{}: scattered rays alone find them", parts.join(" and ")))
    }

    /// What moves while the shutter is open, in words.
    fn moving_parts(&self) -> String {
        let mut parts = Vec::new();
        if self.camera_motion {
            parts.push("camera".to_owned());
        }
        if self.moving_instances > 0 {
            parts.push(format!("{} instances", self.moving_instances));
        }
        if self.deforming > 0 {
            parts.push(format!("{} deforming triangles", self.deforming));
        }
        if self.moving_lights > 0 {
            parts.push(format!("{} lights without a surface", self.moving_lights));
        }
        if parts.is_empty() { "none".to_owned() } else { parts.join(", ") }
    }

    /// The plan as JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let (before, per_vertex) = self.dimensions();
        json!({
            "shapes": self.shapes,
            "triangles": self.triangles,
            "analytic": self.analytic,
            "curves": self.curves,
            "materials": self.materials,
            "bsdfs": self.bsdfs,
            "lights": self.lights,
            "light_kinds": self.light_kinds,
            "light_candidates": self.light_candidates,
            "light_tree": self.light_tree.map(|[leaves, nodes, bytes]| {
                json!({"leaves": leaves, "nodes": nodes, "bytes": bytes})
            }),
            "environment": self.environment,
            "lens": self.lens,
            "alpha": self.alpha,
            "groups": self.groups,
            "instances": self.instances,
            "motion": {
                "any": self.motion,
                "camera": self.camera_motion,
                "instances": self.moving_instances,
                "triangles": self.deforming,
                "lights": self.moving_lights,
            },
            "placed_lights": self.placed_lights,
            "unsampled_lights": self.unsampled_lights,
            "accel": self.accel,
            "file_sampler": self.file_sampler,
            "sampler": "owen-scrambled sobol",
            "dimensions": {"camera": before, "vertex": per_vertex},
            "bytes": {
                "geometry": self.geometry_bytes,
                "accel": self.accel_bytes,
                "textures": self.texture_bytes,
                "texture_means": self.pyramid_bytes,
                "saved": self.saved_bytes,
            },
            "left_out": self.left_out(),
        })
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "There is")?;
        write!(f, "  shapes      {} ({} triangles, {} analytic", self.shapes, self.triangles, self.analytic)?;
        if self.curves > 0 {
            write!(f, ", {} pieces of curves", self.curves)?;
        }
        writeln!(f, ")")?;
        if self.instances > 0 {
            writeln!(f, "  instances   {} of {} groups", self.instances, self.groups)?;
        }
        if self.motion {
            writeln!(f, "  motion      {}", self.moving_parts())?;
        }
        writeln!(f, "  materials   {} ({})", self.materials, join(&self.bsdfs))?;
        writeln!(
            f,
            "  lights      {} ({}); {} sampled a vertex, one shadow ray",
            self.lights,
            join(&self.light_kinds),
            self.light_candidates
        )?;
        if self.placed_lights > 0 {
            writeln!(f, "              {} of them move or are instanced", self.placed_lights)?;
        }
        if self.unsampled_lights > 0 {
            writeln!(f, "              {}", self.unsampled().unwrap_or_default())?;
        }
        if let Some([leaves, nodes, memory]) = self.light_tree {
            writeln!(f, "  light tree  {leaves} emitters in {nodes} nodes of eight, {}", bytes(memory))?;
        }
        writeln!(
            f,
            "  sampler     Owen-scrambled Sobol (the file says `{}`; its sample count is used)",
            self.file_sampler
        )?;
        let (before, per_vertex) = self.dimensions();
        writeln!(f, "  dimensions  {before} for the camera, at most {per_vertex} a vertex")?;
        writeln!(
            f,
            "  memory      geometry {}, accelerator {} ({}), textures and tables {}",
            bytes(self.geometry_bytes),
            bytes(self.accel_bytes),
            self.accel,
            bytes(self.texture_bytes)
        )?;
        if self.pyramid_bytes > 0 {
            writeln!(f, "              means of textures over footprints {}", bytes(self.pyramid_bytes))?;
        }
        writeln!(f, "Left out")?;
        for line in self.left_out() {
            writeln!(f, "  {line}")?;
        }
        Ok(())
    }
}

fn yes(condition: bool) -> &'static str {
    if condition { "yes" } else { "no" }
}

fn join(names: &[&str]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(" ") }
}

/// A size for people.
fn bytes(n: usize) -> String {
    match n {
        0..1024 => format!("{n} B"),
        1024..1_048_576 => format!("{:.1} KiB", n as f64 / 1024.0),
        _ => format!("{:.1} MiB", n as f64 / 1_048_576.0),
    }
}
