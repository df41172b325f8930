//! What the user is told of bad samples: how many, why, and the command that
//! shows the path of each of the first ten.

use std::ffi::OsStr;

use super::args::{RenderArgs, SceneArgs, StageArgs};
use crate::render::{BadSample, BadSamples, RenderStats};
use crate::sampling::Sequence;
use crate::texture::TextureFilter;

/// Says what was left out, and how to look at it.
pub fn tell(args: &RenderArgs, stats: &RenderStats) {
    let bad = &stats.bad;
    if bad.total() == 0 {
        return;
    }
    say!("warning: samples left out: {}", bad.summary());
    if bad.total() > bad.first.len() as u64 {
        say!("  the first {} of them, and how to look at their paths:", bad.first.len());
    }
    for (place, sample) in bad.places().iter().zip(&bad.first) {
        say!("  {place}: {}", replay_command(args, sample, stats.reuse));
    }
}

/// The attributes of a header: counts always, places where there are any.
pub fn attributes(bad: &BadSamples) -> Vec<(String, String)> {
    let mut list = vec![("etendue/badSamples".to_owned(), bad.summary())];
    if !bad.first.is_empty() {
        list.push(("etendue/badSamplesFirst".to_owned(), bad.places().join("\n")));
    }
    list
}

/// The command for a shell that shows the path of a sample of this render:
/// with every option that decides it.
/// `reuse` is what was decided of it.
pub fn replay_command(args: &RenderArgs, bad: &BadSample, reuse: u32) -> String {
    let mut line = Line::default();
    // Exhaustive, so that a new option is not forgotten.
    let SceneArgs {
        scene,
        stage,
        defines,
        size,
        crop,
        integrator,
        max_depth,
        reuse: _,
        accel,
        texture_filter,
        bvh,
        lenient,
    } = &args.scene;
    line.stage(stage);
    for (name, value) in defines {
        line.option("-D", &format!("{name}={value}"));
    }
    if let Some([width, height]) = size {
        line.option("--size", &format!("{width}x{height}"));
    }
    if let Some([x, y, width, height]) = crop {
        line.option("--crop", &format!("{x},{y},{width},{height}"));
    }
    line.maybe("--integrator", integrator.as_ref());
    if let Some(depth) = max_depth {
        line.joined("--max-depth", &depth.to_string());
    }
    if reuse > 1 {
        line.option("--reuse", &reuse.to_string());
    }
    line.maybe("--accel", accel.as_ref());
    line.maybe("--bvh", bvh.as_ref());
    if *texture_filter != TextureFilter::default() {
        line.option("--texture-filter", texture_filter.name());
    }
    line.flag("--lenient", *lenient);
    line.option("--sample", &bad.index.to_string());
    line.option("--seed", &args.seed.to_string());
    if args.sampler != Sequence::default() {
        line.option("--sampler", args.sampler.name());
    }
    line.maybe("--replicas", args.replicas.map(|r| r.to_string()).as_ref());
    let (x, y) = bad.pixel;
    // Neither a name nor a pixel of the border may be taken for an option.
    let dashed = scene.as_os_str().as_encoded_bytes().starts_with(b"-");
    let end = if dashed || x < 0 { " --" } else { "" };
    format!("etendue replay{}{end} {} {x},{y}", line.0, quoted(scene.as_os_str()))
}

/// Options of a command in the making.
#[derive(Default)]
struct Line(String);

impl Line {
    fn stage(&mut self, stage: &StageArgs) {
        let StageArgs { camera, frame, fps, shutter, animation, variant, environment, sun, allow_outside } =
            stage;
        self.maybe("--camera", camera.as_ref());
        if let Some(frame) = frame {
            self.joined("--frame", &frame.to_string());
        }
        if *fps != super::args::FPS {
            self.option("--fps", &fps.to_string());
        }
        if let Some([open, close]) = shutter {
            self.joined("--shutter", &format!("{open},{close}"));
        }
        self.maybe("--animation", animation.as_ref());
        self.maybe("--variant", variant.as_ref());
        self.maybe("--env", environment.as_ref());
        if let Some([up, round]) = sun {
            self.joined("--sun", &format!("{up},{round}"));
        }
        self.flag("--allow-outside", *allow_outside);
    }

    fn flag(&mut self, name: &str, on: bool) {
        if on {
            self.0 += &format!(" {name}");
        }
    }

    fn maybe(&mut self, name: &str, value: Option<&(impl AsRef<OsStr> + ?Sized)>) {
        if let Some(value) = value {
            self.joined_if_dashed(name, value.as_ref());
        }
    }

    fn option(&mut self, name: &str, value: &str) {
        self.0 += &format!(" {name} {}", quoted(OsStr::new(value)));
    }

    /// With `=`, as values that may begin with `-` have to be given.
    fn joined(&mut self, name: &str, value: &str) {
        self.0 += &format!(" {name}={}", quoted(OsStr::new(value)));
    }

    fn joined_if_dashed(&mut self, name: &str, value: &OsStr) {
        let joint = if value.as_encoded_bytes().starts_with(b"-") { '=' } else { ' ' };
        self.0 += &format!(" {name}{joint}{}", quoted(value));
    }
}

/// A word as a shell reads it back: as it is where nothing in it is special,
/// else in quotes; bytes that are no text in the notation of bash and zsh.
fn quoted(word: &OsStr) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./,:=+@%^".contains(c);
    let Some(text) = word.to_str() else {
        let bytes: String = word.as_encoded_bytes().iter().map(|byte| format!("\\x{byte:02x}")).collect();
        return format!("$'{bytes}'");
    };
    if !text.is_empty() && text.chars().all(plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::super::args::{Command, Etendue};
    use super::*;
    use crate::render::Cause;
    use clap::Parser;

    fn render_args(words: &[&str]) -> RenderArgs {
        let all = [&["etendue", "render"], words].concat();
        let Ok(Etendue { command: Command::Render(args) }) = Etendue::try_parse_from(all) else {
            panic!("{words:?} cannot be read")
        };
        args
    }

    const BAD: BadSample = BadSample { pixel: (3, 4), index: 77, cause: Cause::Nan };

    #[test]
    fn short_where_nothing_was_asked_for() {
        let args = render_args(&["a b/it's.xml", "-o", "x.exr"]);
        assert_eq!(
            replay_command(&args, &BAD, 1),
            r"etendue replay --sample 77 --seed 0 'a b/it'\''s.xml' 3,4"
        );
        let border = BadSample { pixel: (-2, -1), ..BAD };
        let args = render_args(&["-o", "x.exr", "--", "-x.xml"]);
        assert_eq!(replay_command(&args, &border, 1), "etendue replay --sample 77 --seed 0 -- -x.xml -2,-1");
    }

    /// What the command is read as, against what was rendered.
    #[test]
    fn every_option_comes_back() {
        let words = [
            "s.xml",
            "-o",
            "x.exr",
            "--camera",
            "main 'view'",
            "--frame=-3.5",
            "--fps",
            "30",
            "--shutter=-0.25,0.5",
            "--animation",
            "walk; rm",
            "--variant",
            "-v",
            "--env",
            "sky $HOME.exr",
            "--sun=12.5,-30",
            "--allow-outside",
            "-D",
            "name=a b\"c",
            "-D",
            "x=1e-3",
            "--size",
            "640x480",
            "--crop",
            "1,2,30,40",
            "--integrator",
            "path",
            "--max-depth=-1",
            "--accel",
            "bvh8",
            "--bvh",
            "fast",
            "--lenient",
            "--seed",
            "18446744073709551615",
            "--sampler",
            "lattice",
            "--reuse",
            "8",
            "--replicas",
            "16",
        ];
        let words: Vec<&str> = words.iter().map(|w| if *w == "-v" { "v -" } else { w }).collect();
        let args = render_args(&words);
        let line = replay_command(&args, &BAD, 8);
        let Ok(Etendue { command: Command::Replay(back) }) = Etendue::try_parse_from(split(&line)) else {
            panic!("{line} cannot be read")
        };
        assert_eq!(format!("{:?}", back.scene), format!("{:?}", args.scene), "{line}");
        assert_eq!(
            (back.pixel, back.sample, back.seed, back.sampler, back.replicas),
            ((3, 4), 77, args.seed, args.sampler, args.replicas)
        );
    }

    /// Words of a line as a shell makes them: quotes of one kind only.
    fn split(line: &str) -> Vec<String> {
        let (mut words, mut word, mut inside, mut chars) = (Vec::new(), String::new(), false, line.chars());
        while let Some(c) = chars.next() {
            match c {
                '\'' => inside = !inside,
                '\\' if !inside => word.extend(chars.next()),
                ' ' if !inside => words.push(std::mem::take(&mut word)),
                c => word.push(c),
            }
        }
        words.push(word);
        words
    }
}
