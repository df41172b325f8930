//! `etendue compare`.

use std::process::ExitCode;

use serde_json::json;

use super::args::CompareArgs;
use crate::desc::Result;
use crate::load::Picture;
use crate::study::{Image, Metrics, Pair, Verdict, ZOptions, ZReport, metrics, z_test};

/// Compares two images; fails when a z-test does.
pub fn run(args: &CompareArgs) -> Result<ExitCode> {
    let (picture, image) = Image::read(&args.image)?;
    let (_, reference) = Image::read(&args.reference)?;
    let pair = Pair::new(image.view()?, reference.view()?)?;
    let measured = metrics(&pair);
    let report = match &args.variance {
        Some(path) => Some(test(&pair, &picture, &Image::read(path)?.1)?),
        None => None,
    };
    if args.json {
        outln!("{:#}", to_json(&measured, report.as_ref()));
    } else {
        outln!("{measured}");
        if let Some(report) = &report {
            outln!("{report}");
        }
    }
    let failed = report.is_some_and(|r| matches!(r.verdict, Verdict::Fail(_)));
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The z-test, with the variance that the image itself tells in its error layer.
fn test(pair: &Pair<'_>, picture: &Picture, variance: &Image) -> Result<ZReport> {
    let own = Image::of(picture, Some("error")).map(|mut image| {
        image.rgb.iter_mut().for_each(|e| *e *= *e);
        image
    });
    let own = own.as_ref().map(Image::view).transpose()?;
    z_test(pair, own, Some(variance.view()?), &ZOptions::default())
}

fn to_json(m: &Metrics, report: Option<&ZReport>) -> serde_json::Value {
    let mut out = json!({
        "mse": m.mse,
        "rel_mse": m.rel_mse,
        "rel_mse_trimmed": m.rel_mse_trimmed,
        "mape": m.mape,
        "smape": m.smape,
        "psnr": m.psnr,
        "flip": m.flip,
        "flip_ldr": m.flip_ldr,
        "skipped": m.skipped,
    });
    if let Some(r) = report {
        out["z_test"] = json!({
            "fraction_inside": r.pixels.fraction_inside,
            "threshold": r.pixels.threshold,
            "blocks_inside": r.blocks.fraction_inside,
            "mean_relative_difference": r.mean_rel_diff,
            "mean_relative_difference_error": r.mean_rel_diff_se,
            "verdict": r.verdict.to_string(),
        });
    }
    out
}
