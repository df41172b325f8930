//! XML with positions: one document, its tags and attributes, and errors that
//! say where a tag was left open.

use std::cell::Cell;

use roxmltree::{Document, Node, ParsingOptions};

use super::substitute::Parameters;
use crate::desc::{Error, Pos, Result};

/// Tags, texts and comments of one file: 2 GB of memory.
const NODES: u32 = 20_000_000;
/// Attributes of one tag, and namespaces of one file: the parser takes the
/// square of them.
const ATTRIBUTES: usize = 200;
const NAMESPACES: usize = 100;

/// The text of one file, and how to name places in it.
#[derive(Debug)]
pub struct Source<'t> {
    /// Index into `SceneDesc::files`.
    pub file: u32,
    /// The file as the user would name it.
    pub name: String,
    text: &'t str,
    line_starts: Vec<usize>,
    /// The offset last asked for and its column: where a file is one line, the
    /// next one is counted from there.
    last: Cell<(usize, usize)>,
}

impl<'t> Source<'t> {
    /// Wraps a text; a byte order mark is dropped.
    pub fn new(file: u32, name: String, text: &'t str) -> Source<'t> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut line_starts = vec![0];
        line_starts.extend(text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i + 1));
        Source { file, name, text, line_starts, last: Cell::new((0, 1)) }
    }

    /// Line and column of a byte offset.
    pub fn pos(&self, offset: usize) -> Pos {
        let offset = offset.min(self.text.len());
        let line = self.line_starts.partition_point(|s| *s <= offset).max(1);
        let start = self.line_starts[line - 1];
        let (from, before) = match self.last.get() {
            (last, column) if (start..=offset).contains(&last) => (last, column),
            _ => (start, 1),
        };
        let column = before + self.text[from..offset].chars().count();
        self.last.set((offset, column));
        Pos { file: self.file, line: line as u32, column: column as u32 }
    }

    /// An error at a byte offset.
    pub fn error(&self, offset: usize, message: impl Into<String>) -> Error {
        Error::new(message).at(self.name.clone(), self.pos(offset))
    }

    /// Parses the text; a DTD is refused.
    pub fn document(&self) -> Result<Document<'t>> {
        self.check_crowds()?;
        let options = ParsingOptions { allow_dtd: false, nodes_limit: NODES, ..ParsingOptions::default() };
        Document::parse_with_options(self.text, options).map_err(|e| self.syntax_error(&e))
    }

    /// Fails on a tag or a file with so many attributes or namespaces that the
    /// parser would take forever.
    fn check_crowds(&self) -> Result<()> {
        if let Some((at, _)) = self.text.match_indices("xmlns").nth(NAMESPACES) {
            return Err(self.error(at, format!("there are more than {NAMESPACES} namespaces in this file")));
        }
        let mut at = 0;
        while let Some(offset) = self.text[at..].find('<') {
            let start = at + offset;
            let rest = &self.text[start..];
            let skip = |end: &str| rest.find(end).map_or(self.text.len(), |i| start + i + end.len());
            at = if rest.starts_with("<!--") {
                skip("-->")
            } else if rest.starts_with("<![CDATA[") {
                skip("]]>")
            } else {
                let end = tag_end(rest).unwrap_or(rest.len());
                if rest[..end].bytes().filter(|b| *b == b'=').count() > ATTRIBUTES
                    && quoted(&rest[..end]) > ATTRIBUTES
                {
                    return Err(self.error(start, format!("a tag has more than {ATTRIBUTES} attributes")));
                }
                start + end
            };
        }
        Ok(())
    }

    fn syntax_error(&self, error: &roxmltree::Error) -> Error {
        use roxmltree::Error as E;
        match error {
            E::DtdDetected => {
                let at = self.text.find("<!DOCTYPE").unwrap_or(0);
                return self.error(at, "a document type definition (DTD) is not allowed here");
            }
            E::NodesLimitReached => {
                return self.error(0, format!("there are more than {NODES} tags and texts in this file"));
            }
            E::NoRootNode => return self.error(0, "there is no tag in this file"),
            E::UnexpectedCloseTag(..) | E::UnclosedRootNode | E::UnexpectedEndOfStream => {
                if let Some(e) = self.unclosed() {
                    return e;
                }
            }
            _ => {}
        }
        let pos = error.pos();
        let text = error.to_string();
        let text = text.strip_suffix(&format!(" at {pos}")).unwrap_or(&text);
        let pos = Pos { file: self.file, line: pos.row, column: pos.col };
        Error::new(format!("malformed XML: {text}")).at(self.name.clone(), pos)
    }

    /// Finds the tag that was left open, if that is what is wrong.
    fn unclosed(&self) -> Option<Error> {
        let mut open: Vec<(&str, usize)> = Vec::new();
        let mut at = 0;
        while let Some(offset) = self.text[at..].find('<') {
            let start = at + offset;
            let rest = &self.text[start..];
            let skip = |end: &str| rest.find(end).map(|i| start + i + end.len());
            if rest.starts_with("<!--") {
                at = skip("-->")?;
            } else if rest.starts_with("<![CDATA[") {
                at = skip("]]>")?;
            } else if rest.starts_with("<?") {
                at = skip("?>")?;
            } else if let Some(close) = rest.strip_prefix("</") {
                let name = tag_name(close);
                let (expected, opened) = open.pop()?;
                if name != expected {
                    let known = open.iter().any(|(n, _)| *n == name);
                    return Some(self.mismatch((expected, opened), (name, start), known));
                }
                at = skip(">")?;
            } else {
                let end = tag_end(rest)?;
                if !rest[..end].ends_with('/') {
                    open.push((tag_name(&rest[1..]), start));
                }
                at = start + end + 1;
            }
        }
        let (name, opened) = open.pop()?;
        Some(
            self.error(opened, format!("`<{name}>` is not closed before the end of the file"))
                .hint(format!("add `</{name}>` or end the tag with `/>`")),
        )
    }

    fn mismatch(&self, open: (&str, usize), close: (&str, usize), known: bool) -> Error {
        if known {
            let line = self.pos(close.1).line;
            return self
                .error(open.1, format!("`<{}>` is not closed before `</{}>` on line {line}", open.0, close.0))
                .hint(format!("add `</{}>` or end the tag with `/>`", open.0));
        }
        let line = self.pos(open.1).line;
        self.error(
            close.1,
            format!("expected `</{}>` for the tag of line {line}, found `</{}>`", open.0, close.0),
        )
    }
}

fn tag_name(text: &str) -> &str {
    let end = text.find(|c: char| c.is_whitespace() || c == '>' || c == '/').unwrap_or(text.len());
    &text[..end]
}

/// Offset of the `>` that ends a tag; quoted ones do not count.
fn tag_end(text: &str) -> Option<usize> {
    let mut quote = None;
    for (i, byte) in text.bytes().enumerate() {
        match (quote, byte) {
            (None, b'>') => return Some(i),
            (None, b'"' | b'\'') => quote = Some(byte),
            (Some(q), b) if q == b => quote = None,
            _ => {}
        }
    }
    None
}

/// How many quoted texts a tag has.
fn quoted(tag: &str) -> usize {
    let (mut quote, mut count) = (None, 0);
    for byte in tag.bytes() {
        match (quote, byte) {
            (None, b'"' | b'\'') => (quote, count) = (Some(byte), count + 1),
            (Some(q), b) if q == b => quote = None,
            _ => {}
        }
    }
    count
}

/// One attribute, parameters replaced.
#[derive(Debug)]
pub struct Attribute<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its value.
    pub value: String,
    /// Offset of the name.
    pub name_at: usize,
    /// Offset of the value.
    pub value_at: usize,
}

/// One tag with its attributes.
pub struct Tag<'a> {
    /// The file it stands in.
    pub source: &'a Source<'a>,
    /// Its name.
    pub name: &'a str,
    /// Offset of its `<`.
    pub at: usize,
    attributes: Vec<Attribute<'a>>,
}

impl<'a> Tag<'a> {
    /// Reads a node's attributes and replaces `$name` in them.
    pub fn new(source: &'a Source<'a>, node: Node<'a, 'a>, parameters: &mut Parameters) -> Result<Tag<'a>> {
        let mut attributes = Vec::new();
        for attribute in node.attributes() {
            let value_at = attribute.range_value().start;
            let value = parameters
                .substitute(attribute.value())
                .map_err(|e| e.at(source.name.clone(), source.pos(value_at)))?;
            let name_at = attribute.range_qname().start;
            attributes.push(Attribute { name: attribute.name(), value, name_at, value_at });
        }
        Ok(Tag { source, name: node.tag_name().name(), at: node.range().start, attributes })
    }

    /// Where the tag opens.
    pub fn pos(&self) -> Pos {
        self.source.pos(self.at)
    }

    /// An error at the tag.
    pub fn error(&self, message: impl Into<String>) -> Error {
        self.source.error(self.at, message)
    }

    /// An error at an attribute's value.
    pub fn error_in(&self, attribute: &Attribute, message: impl Into<String>) -> Error {
        self.source.error(attribute.value_at, message)
    }

    /// An attribute if given.
    pub fn get(&self, name: &str) -> Option<&Attribute<'a>> {
        self.attributes.iter().find(|a| a.name == name)
    }

    /// An attribute that must be given.
    pub fn need(&self, name: &str) -> Result<&Attribute<'a>> {
        self.get(name).ok_or_else(|| self.error(format!("`<{}>` needs the attribute `{name}`", self.name)))
    }

    /// Fails on an attribute that is not in the list.
    pub fn only(&self, known: &[&str]) -> Result<()> {
        match self.attributes.iter().find(|a| !known.contains(&a.name)) {
            None => Ok(()),
            Some(a) => Err(self
                .source
                .error(a.name_at, format!("`<{}>` has no attribute `{}`", self.name, a.name))
                .suggest(a.name, known.iter().copied())),
        }
    }
}
