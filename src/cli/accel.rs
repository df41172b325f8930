//! `etendue accel`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::args::AccelArgs;
use crate::desc::{Error, Result};
use crate::load::{LoadOptions, load, read_mesh};
use crate::save::{check_distinct, check_writable, write_file};
use crate::scene::{BuildOptions, Scene};
use crate::study::tracing::{Contender, Options, RaySet, Report, Subject, displaced, measure, stadium};

/// A subject that has not been made yet: large ones are made one at a time.
enum Source {
    File(PathBuf),
    Displaced(usize),
    Stadium(PathBuf),
}

impl Source {
    fn name(&self) -> String {
        match self {
            Source::File(path) => short_name(path),
            Source::Displaced(n) if n.is_power_of_two() => format!("displaced 2^{}", n.ilog2()),
            Source::Displaced(n) => format!("displaced {n}"),
            Source::Stadium(path) => format!("{} in a stadium", short_name(path)),
        }
    }

    fn make(&self, args: &AccelArgs) -> Result<Subject> {
        match self {
            Source::Displaced(triangles) => displaced(*triangles),
            Source::Stadium(path) => stadium(&read_mesh(path)?),
            Source::File(path) if is_scene(path) => {
                let options = LoadOptions { defines: args.defines.clone(), ..Default::default() };
                let desc = load(path, &options)?;
                Ok(Subject::Scene(Box::new(Scene::build(&desc, &BuildOptions::default())?)))
            }
            Source::File(path) => Subject::mesh(&read_mesh(path)?),
        }
    }
}

/// True for a file that is no single mesh, by its ending.
fn is_scene(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    ["xml", "gltf", "glb"].iter().any(|known| ending == *known)
}

/// A file's name; a `scene.xml` goes by that of its folder.
fn short_name(path: &Path) -> String {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = path.parent().and_then(Path::file_name).map(|s| s.to_string_lossy().into_owned());
    match folder {
        Some(folder) if stem == "scene" => folder,
        _ => stem.trim_end_matches(".ply").to_owned(),
    }
}

/// Builds accelerators and, with `--bench`, traces rays; fails when two of
/// them do not find the same.
pub fn run(args: &AccelArgs) -> Result<ExitCode> {
    let outputs: Vec<&Path> = [&args.csv, &args.json].into_iter().flatten().map(PathBuf::as_path).collect();
    let inputs = args.subjects.iter().map(PathBuf::as_path);
    check_distinct(&inputs.chain(outputs.iter().copied()).collect::<Vec<_>>(), outputs.len())?;
    outputs.into_iter().try_for_each(check_writable)?;
    let names = args
        .accel
        .clone()
        .unwrap_or_else(|| Contender::names().into_iter().filter(|name| name != "brute").collect::<Vec<_>>());
    let contenders = names.iter().map(|name| Contender::named(name)).collect::<Result<Vec<_>>>()?;
    let baseline = match &args.baseline {
        None => 0,
        Some(name) => names.iter().position(|n| n == name).ok_or_else(|| {
            Error::new(format!("the baseline `{name}` is not among the accelerators"))
                .hint(format!("measured are {}", names.join(", ")))
        })?,
    };
    let sets = if args.bench { ray_sets(args)? } else { Vec::new() };
    let options = Options {
        rays: args.rays,
        sets,
        repeats: args.repeats,
        builds: args.builds,
        threads: args.threads,
        verify: args.verify,
        seed: args.seed,
    };
    let mut report = Report { cases: Vec::new(), baseline };
    for source in sources(args)? {
        let name = source.name();
        let subject = source.make(args)?;
        let mut say = |what: &str| say!("{name}: {what}");
        let case = measure(&name, &subject, &contenders, &options, &mut say)?;
        drop(subject);
        report.cases.push(case);
        // What there is so far survives whatever comes next.
        write(args, &report)?;
    }
    out!("{report}");
    Ok(if report.is_wrong() { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn ray_sets(args: &AccelArgs) -> Result<Vec<RaySet>> {
    match &args.sets {
        None => Ok(RaySet::ALL.to_vec()),
        Some(names) => names.iter().map(|name| RaySet::named(name)).collect(),
    }
}

fn sources(args: &AccelArgs) -> Result<Vec<Source>> {
    let mut sources: Vec<Source> = args.subjects.iter().cloned().map(Source::File).collect();
    for text in &args.generate {
        sources.push(parse_generated(text)?);
    }
    if let Some((from, to)) = args.growth {
        sources.extend((from..=to).map(|power| Source::Displaced(1 << power)));
    }
    if sources.is_empty() {
        return Err(Error::new("nothing to build accelerators for")
            .hint("name a scene or a mesh, or use --generate or --growth"));
    }
    Ok(sources)
}

fn parse_generated(text: &str) -> Result<Source> {
    let unknown = || {
        Error::new(format!("cannot generate `{text}`"))
            .hint("expected displaced:TRIANGLES (as in displaced:2^20) or stadium:MESH")
    };
    match text.split_once(':').ok_or_else(unknown)? {
        ("stadium", path) => Ok(Source::Stadium(PathBuf::from(path))),
        ("displaced", count) => {
            let power = count.strip_prefix("2^").and_then(|p| p.parse::<u32>().ok());
            let count = power.and_then(|p| 1usize.checked_shl(p)).or_else(|| count.parse().ok());
            Ok(Source::Displaced(count.ok_or_else(unknown)?))
        }
        _ => Err(unknown()),
    }
}

fn write(args: &AccelArgs, report: &Report) -> Result<()> {
    if let Some(path) = &args.csv {
        write_file(path, report.to_csv().as_bytes())?;
    }
    if let Some(path) = &args.json {
        write_file(path, format!("{:#}\n", report.to_json()).as_bytes())?;
    }
    Ok(())
}
