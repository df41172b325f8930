//! What error is measured against: references that know their own variance
//! and where they come from, and regions.

use std::path::Path;

use serde_json::Value;

use super::{Image, Region, ScenePlan};
use crate::desc::{Error, Fnv, Result};
use crate::load::{Picture, read_picture};

/// A reference, its variance and its provenance.
#[derive(Clone, Debug)]
pub struct Truth {
    /// The file as it was given.
    pub file: String,
    /// Colour, and the layers that the plan asks for.
    pub targets: Vec<TruthTarget>,
    /// Where the variance comes from.
    pub variance_from: Option<String>,
    /// What the header, or the JSON file beside it, says.
    pub provenance: Vec<(String, String)>,
    /// Independent renders that its variance was found from, less one;
    /// infinite where that is not known.
    pub freedom: f64,
    /// 1 / ∫w² of its reconstruction filter in pixels⁻² where that is known:
    /// how much neighbours share. Else 1.
    pub overlap: f64,
    /// Relative standard error of its whole mean, where it is known better
    /// than from its pixels.
    pub mean_error: Option<f64>,
}

/// Colour or a layer of a reference.
#[derive(Clone, Debug)]
pub struct TruthTarget {
    /// `colour`, or the layer's name.
    pub name: String,
    /// The reference itself.
    pub mean: Image,
    /// Variance of its pixel means, colour only.
    pub variance: Option<Image>,
}

/// A part of the picture that is measured apart.
#[derive(Clone, Debug)]
pub struct RegionMask {
    /// Its name.
    pub name: String,
    /// For each pixel, rows from the top.
    pub inside: Vec<bool>,
}

impl Truth {
    /// Reads the reference of a scene, if it has one.
    ///
    /// # Errors
    /// Files that cannot be read, have other sizes, or lack a layer.
    pub fn read(scene: &ScenePlan, layers: &[String]) -> Result<Option<Truth>> {
        let Some(path) = &scene.reference else {
            return match &scene.reference_variance {
                Some(v) => Err(Error::new(format!("`{}` is the variance of no reference", v.display()))
                    .hint("name the reference too")),
                None => Ok(None),
            };
        };
        let (picture, mean) = Image::read(path)?;
        let (variance, variance_from) = variance(scene, &picture, &mean)?;
        let mut targets = vec![TruthTarget { name: "colour".to_owned(), mean, variance }];
        for layer in layers {
            let mean = Image::of(&picture, Some(layer)).ok_or_else(|| {
                Error::new(format!("the reference `{}` has no layer `{layer}`", path.display()))
                    .hint("leave it out of `layers`, or make a reference that has it")
            })?;
            targets.push(TruthTarget { name: layer.clone(), mean, variance: None });
        }
        let beside = beside(path);
        let number = |key: &str| beside.as_ref().and_then(|v| v.get(key)).and_then(Value::as_f64);
        Ok(Some(Truth {
            file: path.display().to_string(),
            targets,
            variance_from,
            provenance: provenance(&picture, beside.as_ref()),
            freedom: number("passes").filter(|n| *n > 1.0).map_or(f64::INFINITY, |n| n - 1.0),
            overlap: number("filter_overlap").filter(|o| *o >= 1.0).unwrap_or(1.0),
            mean_error: number("mean_luminance_relative_error"),
        }))
    }

    /// The reference of colour.
    #[must_use]
    pub fn colour(&self) -> &TruthTarget {
        &self.targets[0]
    }

    /// Takes all that figures depend on into a hash.
    pub fn add_to(&self, hash: &mut Fnv) {
        for target in &self.targets {
            let images = std::iter::once(&target.mean).chain(&target.variance);
            images.flat_map(|i| &i.rgb).for_each(|v| hash.bytes(&v.to_bits().to_le_bytes()));
        }
    }
}

/// The variance of the reference's pixel means, and where it comes from: a
/// file, or the square of its own error layer.
fn variance(scene: &ScenePlan, picture: &Picture, mean: &Image) -> Result<(Option<Image>, Option<String>)> {
    if let Some(path) = &scene.reference_variance {
        let (_, variance) = Image::read(path)?;
        same_size(&path.display().to_string(), &variance, mean)?;
        if variance.rgb.iter().any(|v| !(*v >= 0.0)) {
            return Err(Error::new(format!("`{}` holds no variances: some are negative", path.display())));
        }
        return Ok((Some(variance), Some(path.display().to_string())));
    }
    let own = Image::of(picture, Some("error")).map(|mut image| {
        image.rgb.iter_mut().for_each(|e| *e *= *e);
        image
    });
    let from = own.is_some().then(|| "its own error layer".to_owned());
    Ok((own, from))
}

fn same_size(what: &str, image: &Image, as_this: &Image) -> Result<()> {
    if (image.width, image.height) == (as_this.width, as_this.height) {
        return Ok(());
    }
    Err(Error::new(format!(
        "`{what}` has {}x{} pixels, expected {}x{}",
        image.width, image.height, as_this.width, as_this.height
    )))
}

/// The JSON file of the same name beside a reference, if there is one.
fn beside(path: &Path) -> Option<Value> {
    let text = std::fs::read_to_string(path.with_extension("json")).ok()?;
    serde_json::from_str(&text).ok()
}

/// Scalars of the JSON file, and attributes of the header that a renderer
/// writes of its own.
fn provenance(picture: &Picture, beside: Option<&Value>) -> Vec<(String, String)> {
    let own = picture.attributes.iter().filter(|(name, _)| name.contains('/')).cloned();
    let scalars = beside.and_then(Value::as_object).into_iter().flatten();
    let scalars = scalars.filter_map(|(key, value)| match value {
        Value::String(text) => Some((key.clone(), text.clone())),
        Value::Number(number) => Some((key.clone(), number.to_string())),
        _ => None,
    });
    own.chain(scalars).collect()
}

/// The regions of a scene over pictures of `width` × `height`.
///
/// # Errors
/// Masks that cannot be read or have another size; regions without pixels.
pub fn regions(scene: &ScenePlan, [width, height]: [usize; 2]) -> Result<Vec<RegionMask>> {
    let mut all = Vec::new();
    for (name, region) in &scene.regions {
        let inside: Vec<bool> = match region {
            Region::Rectangle([x, y, w, h]) => {
                let within = |v: usize, from: u32, count: u32| {
                    v >= from as usize && v < from as usize + count as usize
                };
                (0..width * height).map(|i| within(i % width, *x, *w) && within(i / width, *y, *h)).collect()
            }
            Region::Mask(path) => {
                let picture = read_picture(path)?;
                if (picture.width as usize, picture.height as usize) != (width, height) {
                    return Err(Error::new(format!(
                        "the mask `{}` has {}x{} pixels, the picture {width}x{height}",
                        path.display(),
                        picture.width,
                        picture.height
                    )));
                }
                let values = picture.channel("Y").or_else(|| picture.channel("R"));
                let values = values.ok_or_else(|| {
                    Error::new(format!("the mask `{}` has no channel Y or R", path.display()))
                })?;
                values.iter().map(|v| *v > 0.5).collect()
            }
        };
        if !inside.contains(&true) {
            return Err(Error::new(format!("the region `{name}` has no pixel in the picture")));
        }
        all.push(RegionMask { name: name.clone(), inside });
    }
    Ok(all)
}
