//! The rules that a machine can check and the compiler does not: which room
//! imports which, sizes, licences, leftovers.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Every room and its floor. A room imports only rooms of lower floors; the
/// one import within a floor is listed in [`SAME_FLOOR`].
const ROOMS: &[(&str, u32)] = &[
    ("math", 0),
    ("desc", 0),
    ("color", 1),
    ("sampling", 1),
    ("texture", 2),
    ("bsdf", 2),
    ("shape", 2),
    ("material", 3),
    ("light", 3),
    ("camera", 3),
    ("medium", 3),
    ("accel", 3),
    ("scene", 4),
    ("film", 3),
    ("integrator", 5),
    ("render", 6),
    ("load", 6),
    ("save", 6),
    ("study", 7),
    ("selftest", 8),
    ("cli", 9),
];

/// A description holds the positions and transforms that `math` defines.
const SAME_FLOOR: &[(&str, &str)] = &[("desc", "math")];

/// Lines of a source file, its tests included.
const MAX_LINES: usize = 700;
/// The same for a file of tests: a list of cases is one idea however long.
const MAX_TEST_LINES: usize = 900;
/// Bytes of any file, and of all together.
const MAX_FILE: u64 = 3_500_000;
const MAX_TOTAL: u64 = 60_000_000;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All files below `folder`, sorted, without what building leaves behind.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_symlink() || [".git", "target", ".venv", "out", "__pycache__"].contains(&name.as_str()) {
            continue;
        }
        if path.is_dir() { found.extend(files_below(&path)) } else { found.push(path) }
    }
    found
}

/// Rust files of the package with their text.
fn sources() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for folder in ["src", "tests", "benches", "examples"] {
        let folder = root().join(folder);
        if folder.is_dir() {
            found.extend(
                files_below(&folder).into_iter().filter(|p| p.extension().is_some_and(|e| e == "rs")),
            );
        }
    }
    assert!(found.len() > 20, "only {} sources found", found.len());
    found.into_iter().map(|path| (path.clone(), fs::read_to_string(&path).unwrap())).collect()
}

/// The source without comments, strings and character literals (each becomes
/// a blank), so that what is left is code.
fn code_only(source: &str) -> String {
    let bytes: Vec<char> = source.chars().collect();
    let (mut code, mut i) = (String::with_capacity(source.len()), 0);
    let ahead = |i: usize, text: &str| text.chars().enumerate().all(|(k, c)| bytes.get(i + k) == Some(&c));
    while i < bytes.len() {
        let from = i;
        if ahead(i, "//") {
            while i < bytes.len() && bytes[i] != '\n' {
                i += 1;
            }
        } else if ahead(i, "/*") {
            let mut depth = 0;
            loop {
                if ahead(i, "/*") {
                    (depth, i) = (depth + 1, i + 2);
                } else if ahead(i, "*/") {
                    (depth, i) = (depth - 1, i + 2);
                } else {
                    i += 1;
                }
                if depth == 0 || i >= bytes.len() {
                    break;
                }
            }
        } else if let Some(end) = literal_end(&bytes, i) {
            i = end;
        } else {
            code.push(bytes[i]);
            i += 1;
            continue;
        }
        let skipped = &bytes[from..i.min(bytes.len())];
        code.extend(skipped.iter().map(|c| if *c == '\n' { '\n' } else { ' ' }));
    }
    code
}

/// One past the end of the string or character literal that begins at `i`.
fn literal_end(text: &[char], i: usize) -> Option<usize> {
    let after_word = i > 0 && (text[i - 1].is_alphanumeric() || text[i - 1] == '_');
    let at = |k: usize| text.get(k).copied();
    let raw = match at(i)? {
        'r' if !after_word => i + 1,
        'b' if !after_word && at(i + 1) == Some('r') => i + 2,
        '"' => return closing(text, i + 1, '"'),
        // A lifetime has no closing quote within two characters.
        '\'' if at(i + 1) == Some('\\') || at(i + 2) == Some('\'') => return closing(text, i + 1, '\''),
        _ => return None,
    };
    let hashes = text[raw..].iter().take_while(|c| **c == '#').count();
    if at(raw + hashes) != Some('"') {
        return None;
    }
    let end: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
    let body = raw + hashes + 1;
    let length = text[body..].windows(end.len()).position(|w| w == end)?;
    Some(body + length + end.len())
}

/// One past the next unescaped `quote`.
fn closing(text: &[char], mut i: usize, quote: char) -> Option<usize> {
    while i < text.len() {
        match text[i] {
            '\\' => i += 2,
            c if c == quote => return Some(i + 1),
            _ => i += 1,
        }
    }
    None
}

/// Every room named by a path that begins with `crate::` in the code, also
/// inside of `use crate::{…}`.
fn imported_rooms(code: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (at, _) in code.match_indices("crate") {
        let before = code[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let Some(rest) = code[at + 5..].trim_start().strip_prefix("::") else { continue };
        let rest = rest.trim_start();
        match rest.strip_prefix('{') {
            Some(group) => found.extend(top_names(group)),
            None => found.extend(first_word(rest)),
        }
    }
    found
}

/// First words of the comma-separated paths up to the closing brace.
fn top_names(group: &str) -> Vec<String> {
    let (mut depth, mut start, mut names) = (0, 0, Vec::new());
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                names.extend(first_word(group[start..i].trim_start()));
                start = i + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    names
}

fn first_word(text: &str) -> Option<String> {
    let word: String = text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    (!word.is_empty()).then_some(word)
}

/// The imports of `room` that the table does not allow.
fn forbidden(room: &str, imports: &BTreeSet<String>) -> Vec<String> {
    let floor = |name: &str| ROOMS.iter().find(|(room, _)| *room == name).map(|(_, floor)| *floor);
    let Some(own) = floor(room) else { return vec![format!("{room} is not in the table")] };
    let mut broken = Vec::new();
    for import in imports.iter().filter(|import| *import != room) {
        let allowed = match floor(import) {
            Some(other) => other < own || SAME_FLOOR.contains(&(room, import)),
            // An exported macro, or something at the crate's root: no room.
            None => false,
        };
        if !allowed {
            broken.push(format!("{room} imports {import}"));
        }
    }
    broken
}

#[test]
fn rooms_import_lower_floors_only() {
    let (mut rooms_seen, mut imports_seen, mut broken) = (BTreeSet::new(), 0, Vec::new());
    for (path, source) in sources() {
        let Ok(inside) = path.strip_prefix(root().join("src")) else { continue };
        let parts: Vec<String> =
            inside.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
        let name = parts[0].trim_end_matches(".rs").to_string();
        if name == "lib" || name == "main" {
            continue;
        }
        let imports = imported_rooms(&code_only(&source));
        imports_seen += imports.len();
        broken.extend(forbidden(&name, &imports).into_iter().map(|b| format!("{}: {b}", inside.display())));
        rooms_seen.insert(name);
    }
    assert!(broken.is_empty(), "imports against the table:\n{}", broken.join("\n"));
    let table: BTreeSet<String> = ROOMS.iter().map(|(room, _)| (*room).to_string()).collect();
    assert_eq!(rooms_seen, table, "the rooms in src/ and those in the table differ");
    assert!(imports_seen > 0);
}

#[test]
fn import_parser_sees_every_spelling() {
    let source = r##"
        //! crate::cli in a comment, `use crate::render`
        use crate::math::{Vec3, Rgb};
        use crate::{desc::{Error, Result as R}, film, scene::Scene as S};
        pub(crate) fn f(x: crate :: shape::Hit) -> &'static str { "crate::save" }
        /* crate::load /* nested */ crate::load */
        const R: &str = r#"crate::study"#; const C: char = '"';
        fn g<'a>(q: &'a u8) { let _ = ('\'', crate::light::X, mycrate::camera); }
    "##;
    let names: Vec<String> = imported_rooms(&code_only(source)).into_iter().collect();
    assert_eq!(names, ["desc", "film", "light", "math", "scene", "shape"]);
}

#[test]
fn import_rule_catches_each_kind_of_break() {
    let broken =
        |room: &str, import: &str| !forbidden(room, &BTreeSet::from([import.to_string()])).is_empty();
    for (room, import) in [
        ("math", "desc"),
        ("shape", "bsdf"),
        ("accel", "scene"),
        ("film", "scene"),
        ("load", "render"),
        ("bsdf", "texture"),
        ("cellar", "math"),
        ("cli", "cellar"),
    ] {
        assert!(broken(room, import), "{room} may import {import}");
    }
    for (room, import) in
        [("desc", "math"), ("cli", "study"), ("study", "load"), ("light", "shape"), ("scene", "scene")]
    {
        assert!(!broken(room, import), "{room} may not import {import}");
    }
}

#[test]
fn sources_are_short() {
    let long: Vec<String> = sources()
        .iter()
        .filter(|(path, source)| {
            let in_tests = path.components().any(|c| c.as_os_str() == "tests");
            source.lines().count() > if in_tests { MAX_TEST_LINES } else { MAX_LINES }
        })
        .map(|(path, source)| format!("{}: {} lines", path.display(), source.lines().count()))
        .collect();
    assert!(long.is_empty(), "over {MAX_LINES} lines:\n{}", long.join("\n"));
}

#[test]
fn sources_open_with_what_they_are() {
    let silent: Vec<PathBuf> = sources()
        .into_iter()
        .filter(|(_, source)| !source.starts_with("//!"))
        .map(|(path, _)| path)
        .collect();
    assert!(silent.is_empty(), "no `//!` at the top: {silent:?}");
}

/// Code that the compiler cannot check stays where the lint is lifted.
#[test]
fn unsafe_code_is_in_two_places() {
    let (mut allowed, mut elsewhere) = (BTreeSet::new(), Vec::new());
    for (path, source) in sources() {
        let code = code_only(&source);
        let words = code.split(|c: char| !c.is_alphanumeric() && c != '_');
        if !words.into_iter().any(|word| word == "unsafe") {
            continue;
        }
        let name = path.strip_prefix(root()).unwrap().to_string_lossy().into_owned();
        if name.starts_with("src/accel/simd") || name.starts_with("src/accel/embree") {
            assert!(source.contains("// SAFETY:"), "{name} does not say why it is sound");
            allowed.insert(name);
        } else {
            elsewhere.push(name);
        }
    }
    assert!(elsewhere.is_empty(), "unsafe code in {elsewhere:?}");
    assert!(allowed.len() >= 2, "only in {allowed:?}");
}

#[test]
fn nothing_is_left_undone() {
    // Spelled in two halves so that this file passes its own rule.
    let marks = [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("#[ig", "nore"), concat!("XX", "X:")];
    let mut found = Vec::new();
    for (path, source) in sources() {
        for (number, line) in source.lines().enumerate() {
            if marks.iter().any(|mark| line.contains(mark)) {
                found.push(format!("{}:{}: {}", path.display(), number + 1, line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "left undone:\n{}", found.join("\n"));
}

#[test]
fn scenes_carry_licence_and_source() {
    let mut count = 0;
    for entry in fs::read_dir(root().join("scenes")).unwrap() {
        let folder = entry.unwrap().path();
        if !folder.is_dir() {
            continue;
        }
        count += 1;
        for name in ["LICENSE.txt", "SOURCE.txt"] {
            let text = fs::read_to_string(folder.join(name)).unwrap_or_default();
            assert!(text.len() > 40, "{} has no {name}", folder.display());
        }
    }
    assert!(count >= 8, "{count} scenes");
}

#[test]
fn the_repository_stays_small() {
    let mut total = 0;
    for path in files_below(root()) {
        let size = fs::metadata(&path).unwrap().len();
        assert!(size <= MAX_FILE, "{} has {size} bytes", path.display());
        total += size;
    }
    assert!(total <= MAX_TOTAL, "{total} bytes in all");
}

#[test]
fn references_are_complete() {
    let folder = root().join("refs");
    let mut count = 0;
    for path in files_below(&folder) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let Some(stem) = name.strip_suffix(".json").filter(|stem| *stem != "refs") else { continue };
        count += 1;
        for suffix in ["exr", "var.exr"] {
            assert!(folder.join(format!("{stem}.{suffix}")).is_file(), "{stem}.{suffix} is missing");
        }
    }
    assert!(count >= 20, "{count} references");
}
