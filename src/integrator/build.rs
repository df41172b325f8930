//! Reads the `<integrator>` of a scene; names, parameters and defaults as in
//! Mitsuba 3.9, and two of our own (`whitted`, `ao`). `volpath` is the same path
//! tracer as `path`, which knows media as well, but for it surfaces where
//! nothing happens (`null`) do not make a path longer. Both have a parameter of our own,
//! `reuse`: the number of pixels that use each other's paths (1: none; 0: what a trial finds better).

use super::{AmbientOcclusion, Depth, Direct, Integrator, Path, Whitted};
use crate::desc::{Category, Error, ObjectId, Params, Result, SceneDesc};
use crate::film::{LayerSet, TILE_SIZE};
use crate::math::Rgb;

/// Scene-file names of all integrators.
pub const NAMES: &[&str] = &["path", "volpath", "direct", "whitted", "ao", "depth", "moment", "aov"];

/// Choices of the command line that go over the scene file.
#[derive(Clone, Debug, Default)]
pub struct IntegratorOptions {
    /// Another integrator than the file's, with its default parameters.
    pub name: Option<String>,
    /// Another `max_depth` than the file's; −1 is no limit.
    pub max_depth: Option<i64>,
    /// Pixels that use each other's paths, instead of the file's; 1 for none,
    /// [`AUTO_REUSE`] for what a trial finds better.
    pub reuse: Option<u32>,
    /// The same where neither this nor the file says anything.
    pub reuse_unsaid: Option<u32>,
}

/// Deepest ray tree of `whitted`: its branches double with every level.
const WHITTED_MAX_DEPTH: u32 = 64;

impl Integrator {
    /// The integrator of a scene; `path` without limits if it names none.
    ///
    /// # Errors
    /// Unknown names and parameters, values out of range.
    pub fn from_desc(desc: &SceneDesc, options: &IntegratorOptions) -> Result<Integrator> {
        let root = desc.params(desc.root);
        let found = root.children(Category::Integrator);
        if let [_, (_, second), ..] = found.as_slice() {
            return Err(desc.error(desc.object(*second).pos, "a scene has one integrator only"));
        }
        let mut said = false;
        let mut integrator = match found.first() {
            Some((_, id)) => {
                let params = desc.params(inside(desc, *id, &mut Layers::default())?);
                said = params.has("reuse");
                // One that is not ours may be replaced by the command line.
                if !NAMES.contains(&params.object().plugin.as_str())
                    && let Some(name) = &options.name
                {
                    let limits = Path {
                        max_depth: max_depth(&params, -1)?,
                        hide_emitters: params.bool("hide_emitters", false)?,
                        ..DEFAULT_PATH
                    };
                    Integrator::named(name, &Integrator::Path(limits))?
                } else {
                    let integrator = read(&params)?;
                    params.finish()?;
                    integrator
                }
            }
            None => Integrator::Path(DEFAULT_PATH),
        };
        if let Some(name) = &options.name
            && name != integrator.name()
        {
            integrator = Integrator::named(name, &integrator)?;
        }
        if let Some(depth) = options.max_depth {
            integrator.limit_depth(depth)?;
        }
        if let Some(pixels) = options.reuse.or(options.reuse_unsaid.filter(|_| !said)) {
            match &mut integrator {
                Integrator::Path(path) => path.reuse = pixels,
                _ if options.reuse.is_none() => {}
                other => {
                    return Err(Error::new(format!(
                        "integrator `{}` has no paths to use again",
                        other.name()
                    ))
                    .hint("--reuse goes with `path` or `volpath`"));
                }
            }
        }
        Ok(integrator)
    }

    /// The layers that the scene's integrator asks for, by `moment` and `aov`,
    /// and a note on each that has another name in the picture than in the file.
    ///
    /// # Errors
    /// As [`Integrator::from_desc`].
    pub fn layers_from_desc(desc: &SceneDesc) -> Result<(LayerSet, Vec<String>)> {
        let mut found = Layers::default();
        if let Some((_, id)) = desc.params(desc.root).children(Category::Integrator).first() {
            inside(desc, *id, &mut found)?;
        }
        Ok((found.set, found.renamed))
    }

    /// An integrator by name; what `like` limits (depth, hidden emitters) stays.
    fn named(name: &str, like: &Integrator) -> Result<Integrator> {
        let (max_depth, hide_emitters) = match like {
            Integrator::Path(p) => (p.max_depth, p.hide_emitters),
            Integrator::Whitted(w) => (w.max_depth, w.hide_emitters),
            Integrator::Direct(d) => (u32::MAX, d.hide_emitters),
            _ => (u32::MAX, false),
        };
        Ok(match name {
            "path" | "volpath" => {
                let see_through = name == "volpath";
                Integrator::Path(Path { max_depth, hide_emitters, see_through, ..DEFAULT_PATH })
            }
            "direct" => Integrator::Direct(Direct { emitter_samples: 1, bsdf_samples: 1, hide_emitters }),
            "whitted" => Integrator::Whitted(Whitted {
                max_depth: max_depth.min(DEFAULT_WHITTED.max_depth),
                hide_emitters,
                ..DEFAULT_WHITTED
            }),
            "ao" => Integrator::AmbientOcclusion(AmbientOcclusion { distance: f32::INFINITY }),
            "depth" => Integrator::Depth(Depth),
            _ => {
                return Err(
                    Error::new(format!("unknown integrator `{name}`")).suggest(name, NAMES.iter().copied())
                );
            }
        })
    }

    fn limit_depth(&mut self, depth: i64) -> Result<()> {
        let limit = depth_limit(depth)
            .ok_or_else(|| Error::new(format!("--max-depth must be −1 or more, found {depth}")))?;
        match self {
            Integrator::Path(path) => path.max_depth = limit,
            Integrator::Whitted(whitted) => whitted.max_depth = limit.min(WHITTED_MAX_DEPTH),
            other => {
                return Err(Error::new(format!("integrator `{}` has no depth to limit", other.name()))
                    .hint("--max-depth goes with `path` or `whitted`"));
            }
        }
        Ok(())
    }
}

const DEFAULT_PATH: Path =
    Path { max_depth: u32::MAX, rr_depth: 5, hide_emitters: false, see_through: false, reuse: 1 };

/// Whether pixels use each other's paths is to be tried out.
pub const AUTO_REUSE: u32 = 0;

/// Most pixels that use each other's paths: those of a tile.
pub const MOST_REUSE: u32 = (TILE_SIZE * TILE_SIZE) as u32;

const DEFAULT_WHITTED: Whitted = Whitted { max_depth: 8, ambient: None, cutoff: 1e-3, hide_emitters: false };

/// Mitsuba's depth: −1 is no limit.
fn depth_limit(depth: i64) -> Option<u32> {
    match depth {
        -1 => Some(u32::MAX),
        0.. => Some(u32::try_from(depth).unwrap_or(u32::MAX)),
        _ => None,
    }
}

/// What integrators that hold another ask for.
#[derive(Default)]
struct Layers {
    set: LayerSet,
    renamed: Vec<String>,
}

/// The integrator in `moment` and `aov`, which only ask for more layers: the
/// mean square of the samples (`m2`), and those that `aovs` lists as
/// `name:type`. Layers have the names that compositing programs know.
fn inside(desc: &SceneDesc, id: ObjectId, found: &mut Layers) -> Result<ObjectId> {
    let params = desc.params(id);
    match params.object().plugin.as_str() {
        "moment" => found.set.moment = true,
        "aov" => {
            let list = params.string_opt("aovs")?.unwrap_or_default();
            for entry in list.split(',').map(str::trim).filter(|entry| !entry.is_empty()) {
                aov(&params, entry, found)?;
            }
        }
        _ => return Ok(id),
    }
    let nested = params.children(Category::Integrator);
    let [(_, nested)] = nested.as_slice() else {
        let name = &params.object().plugin;
        let message = format!("integrator `{name}` needs one integrator inside, found {}", nested.len());
        return Err(params.error(message));
    };
    params.finish()?;
    inside(desc, *nested, found)
}

/// One `name:type` of an `aov`.
fn aov(params: &Params, entry: &str, found: &mut Layers) -> Result<()> {
    let (name, kind) = entry.split_once(':').map_or((entry, entry), |(n, k)| (n.trim(), k.trim()));
    let (layer, standard) = match kind {
        "depth" => (&mut found.set.depth, "Z"),
        "position" => (&mut found.set.position, "P"),
        "sh_normal" => (&mut found.set.normal, "N"),
        "albedo" => (&mut found.set.albedo, "albedo"),
        other => {
            return Err(params
                .error_at("aovs", format!("there is no layer of type `{other}`"))
                .suggest(other, ["depth", "position", "sh_normal", "albedo"]));
        }
    };
    *layer = true;
    if name != standard {
        found.renamed.push(format!("the layer `{name}` of type `{kind}` is written as `{standard}`"));
    }
    Ok(())
}

fn max_depth(params: &Params, default: i64) -> Result<u32> {
    let depth = params.int("max_depth", default)?;
    depth_limit(depth).ok_or_else(|| {
        params.error_at("max_depth", format!("`max_depth` must be −1 (no limit) or more, found {depth}"))
    })
}

/// A number of pixels that use each other's paths, as the command line writes it: `auto` for
/// [`AUTO_REUSE`].
#[must_use]
pub fn reuse_named(text: &str) -> Option<u32> {
    match text {
        "auto" => Some(AUTO_REUSE),
        _ => text.parse().ok().filter(|n| (1..=MOST_REUSE).contains(n)),
    }
}

/// Our own: pixels that use each other's paths.
fn reuse(params: &Params) -> Result<u32> {
    let pixels = params.int("reuse", 1)?;
    u32::try_from(pixels).ok().filter(|n| *n <= MOST_REUSE).ok_or_else(|| {
        params.error_at("reuse", format!("`reuse` must be from 1 to {MOST_REUSE} pixels, or 0 for what a trial finds better, found {pixels}"))
    })
}

fn read(params: &Params) -> Result<Integrator> {
    let hide_emitters = || params.bool("hide_emitters", false);
    Ok(match params.object().plugin.as_str() {
        name @ ("path" | "volpath") => {
            let rr_depth = params.int("rr_depth", 5)?;
            if rr_depth < 1 {
                let message = format!("`rr_depth` must be at least 1, found {rr_depth}");
                return Err(params.error_at("rr_depth", message));
            }
            Integrator::Path(Path {
                max_depth: max_depth(params, -1)?,
                rr_depth: u32::try_from(rr_depth).unwrap_or(u32::MAX),
                hide_emitters: hide_emitters()?,
                see_through: name == "volpath",
                reuse: reuse(params)?,
            })
        }
        "direct" => {
            if params.has("shading_samples") && (params.has("emitter_samples") || params.has("bsdf_samples"))
            {
                let message =
                    "give either `shading_samples` or `emitter_samples` and `bsdf_samples`, not both";
                return Err(params.error_at("shading_samples", message));
            }
            let shading = params.int("shading_samples", 1)?;
            let count = |name| -> Result<u32> {
                let n = params.int(name, shading)?;
                match u32::try_from(n) {
                    Ok(n) if n <= 1 << 16 => Ok(n),
                    _ => Err(params.error_at(name, format!("`{name}` must be from 0 to 65536, found {n}"))),
                }
            };
            let (emitter_samples, bsdf_samples) = (count("emitter_samples")?, count("bsdf_samples")?);
            if emitter_samples + bsdf_samples == 0 {
                return Err(params.error("integrator `direct` needs at least one light or bsdf sample"));
            }
            Integrator::Direct(Direct { emitter_samples, bsdf_samples, hide_emitters: hide_emitters()? })
        }
        "whitted" => {
            let ambient = if params.has("ambient") { Some(params.rgb("ambient", Rgb::ZERO)?) } else { None };
            let cutoff = params.float("cutoff", f64::from(DEFAULT_WHITTED.cutoff))? as f32;
            let max_depth = max_depth(params, i64::from(DEFAULT_WHITTED.max_depth))?.min(WHITTED_MAX_DEPTH);
            Integrator::Whitted(Whitted { max_depth, ambient, cutoff, hide_emitters: hide_emitters()? })
        }
        "ao" => {
            let distance = params.float_opt("distance")?.unwrap_or(f64::INFINITY);
            if !(distance > 0.0) {
                return Err(
                    params.error_at("distance", format!("`distance` must be positive, found {distance}"))
                );
            }
            Integrator::AmbientOcclusion(AmbientOcclusion { distance: distance as f32 })
        }
        "depth" => Integrator::Depth(Depth),
        name => {
            return Err(params
                .error(format!("unknown integrator `{name}`"))
                .suggest(name, NAMES.iter().copied()));
        }
    })
}
