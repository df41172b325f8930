//! `$name` in attributes: defines given by the user and `<default>` tags.

use crate::desc::{Error, Result, nearest};

#[derive(Debug)]
struct Parameter {
    name: String,
    value: String,
    used: bool,
    from_user: bool,
}

/// The values known so far.
#[derive(Debug)]
pub struct Parameters {
    /// Longest name first, so that `$ab` is not taken for `$a` and a `b`.
    list: Vec<Parameter>,
    /// Bytes of all values that had parameters to replace.
    replaced: usize,
}

/// Longest value an attribute may reach by substitution.
const VALUE_CAP: usize = 1 << 20;
/// Bytes that all of them may reach together: without, a few hundred bytes
/// could stand for any number of them.
const TOTAL_CAP: usize = 256 << 20;
/// Parameters of one scene.
const PARAMETERS: usize = 10_000;

impl Parameters {
    /// Starts with the user's defines; a name given twice is an error.
    pub fn new(defines: &[(String, String)]) -> Result<Parameters> {
        let mut parameters = Parameters { list: Vec::new(), replaced: 0 };
        for (name, value) in defines {
            if name.is_empty() {
                return Err(Error::new("the name of a define is empty"));
            }
            if parameters.list.iter().any(|p| p.name == *name) {
                return Err(Error::new(format!("`{name}` is defined twice")));
            }
            parameters.insert(name, value, true);
        }
        Ok(parameters)
    }

    /// A `<default>`: used unless the name has a value already.
    pub fn default(&mut self, name: &str, value: &str) -> Result<()> {
        if self.list.iter().any(|p| p.name == name) {
            return Ok(());
        }
        if self.list.len() >= PARAMETERS {
            return Err(Error::new(format!("there are more than {PARAMETERS} parameters")));
        }
        self.insert(name, value, false);
        Ok(())
    }

    fn insert(&mut self, name: &str, value: &str, from_user: bool) {
        let at = self.list.partition_point(|p| p.name.len() >= name.len());
        let parameter = Parameter { name: name.into(), value: value.into(), used: false, from_user };
        self.list.insert(at, parameter);
    }

    /// Replaces every `$name`; `\$` stands for a dollar sign.
    pub fn substitute(&mut self, text: &str) -> Result<String> {
        if !text.contains('$') {
            return Ok(text.to_owned());
        }
        let mut out = String::with_capacity(text.len());
        let mut rest = text;
        while let Some(at) = rest.find('$') {
            if let Some(before) = rest[..at].strip_suffix('\\') {
                out.push_str(before);
                out.push('$');
                rest = &rest[at + 1..];
                continue;
            }
            out.push_str(&rest[..at]);
            rest = &rest[at + 1..];
            let Some(parameter) = self.list.iter_mut().find(|p| rest.starts_with(&p.name)) else {
                return Err(self.undefined(rest));
            };
            parameter.used = true;
            out.push_str(&parameter.value);
            rest = &rest[parameter.name.len()..];
            if out.len() > VALUE_CAP {
                return Err(Error::new("the value grows too long when its parameters are replaced"));
            }
        }
        out.push_str(rest);
        self.replaced += out.len();
        if self.replaced > TOTAL_CAP {
            return Err(Error::new(format!(
                "the values grow to more than {TOTAL_CAP} bytes when their parameters are replaced"
            )));
        }
        Ok(out)
    }

    fn undefined(&self, rest: &str) -> Error {
        let name = &rest[..rest.find(|c| !is_name_char(c)).unwrap_or(rest.len())];
        let error = Error::new(format!("the parameter `${name}` is not defined"));
        match nearest(name, self.list.iter().map(|p| p.name.as_str())) {
            Some(near) => error.hint(format!("did you mean `${near}`?")),
            None => error.hint(format!(
                "give it a value with `-D {name}=…` or `<default name=\"{name}\" value=\"…\"/>`; \
                 write `\\$` for a dollar sign"
            )),
        }
    }

    /// Fails if a define of the user was never used.
    pub fn check_used(&self) -> Result<()> {
        let Some(unused) = self.list.iter().find(|p| p.from_user && !p.used) else { return Ok(()) };
        let known = self.list.iter().filter(|p| !p.from_user || p.used).map(|p| p.name.as_str());
        let error = Error::new(format!("the define `{}` is not used by the scene", unused.name));
        Err(error.suggest(&unused.name, known))
    }
}

fn is_name_char(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}
