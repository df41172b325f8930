//! References to object ids; cycles and scenes that unfold without end.

use std::collections::HashMap;

use super::parse::Parsed;
use crate::desc::{Category, Error, ObjectId, Result, SceneDesc, Value, nearest};

/// Objects inside objects, references followed.
const NESTING: u32 = 128;
/// Objects of the tree that the references unfold to.
const UNFOLDED: u64 = 50_000_000;
/// The same of what stands for one surface, light or sensor, where none needs
/// many and all of them are built.
const UNFOLDED_IN_ONE: u64 = 4096;

/// Gives every pending reference its object, then checks that following them
/// ends.
pub fn resolve(parsed: &mut Parsed) -> Result<()> {
    for pending in &parsed.pending {
        let pos = parsed.scene.object(pending.owner).params[pending.param].pos;
        let Some(id) = parsed.ids.get(&pending.id).copied() else {
            let error = parsed.scene.error(pos, format!("no object has the id `{}`", pending.id));
            return Err(suggest_id(error, &pending.id, &parsed.ids));
        };
        parsed.scene.objects[pending.owner as usize].params[pending.param].value = Value::Object(id);
    }
    check_finite(&parsed.scene)
}

/// Adds the nearest known id, or all of them when they are few.
pub fn suggest_id(error: Error, id: &str, ids: &HashMap<String, ObjectId>) -> Error {
    let mut known: Vec<&str> = ids.keys().map(String::as_str).collect();
    known.sort_unstable();
    if known.len() > 12 {
        return match nearest(id, known) {
            Some(near) => error.hint(format!("did you mean `{near}`?")),
            None => error,
        };
    }
    error.suggest(id, known)
}

fn children(scene: &SceneDesc, id: ObjectId) -> Vec<ObjectId> {
    let of_param = |v: &Value| if let Value::Object(child) = v { Some(*child) } else { None };
    scene.object(id).params.iter().filter_map(|p| of_param(&p.value)).collect()
}

/// Depth-first search with an explicit stack: a cycle, too deep a nesting and
/// too large an unfolded tree are errors.
fn check_finite(scene: &SceneDesc) -> Result<()> {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done { height: u32, size: u64 },
    }
    let mut states = vec![State::New; scene.objects.len()];
    for start in 0..scene.objects.len() as ObjectId {
        let mut stack = vec![(start, children(scene, start), 0)];
        if states[start as usize] != State::New {
            continue;
        }
        states[start as usize] = State::Open;
        while let Some((id, below, next)) = stack.last_mut() {
            if let Some(child) = below.get(*next).copied() {
                *next += 1;
                match states[child as usize] {
                    State::New => {
                        states[child as usize] = State::Open;
                        stack.push((child, children(scene, child), 0));
                    }
                    State::Open => return Err(cycle(scene, &stack, child)),
                    State::Done { .. } => {}
                }
                continue;
            }
            let (mut height, mut size) = (1, 1u64);
            for child in below.iter() {
                if let State::Done { height: h, size: s } = states[*child as usize] {
                    height = height.max(h + 1);
                    size = size.saturating_add(s);
                }
            }
            let pos = scene.object(*id).pos;
            if height > NESTING {
                return Err(scene.error(pos, format!("objects are nested more than {NESTING} deep here")));
            }
            let one = !matches!(scene.object(*id).category, Category::Scene | Category::Shape);
            if size > if one { UNFOLDED_IN_ONE } else { UNFOLDED } {
                return Err(scene.error(pos, "references unfold to too many objects here"));
            }
            states[*id as usize] = State::Done { height, size };
            stack.pop();
        }
    }
    Ok(())
}

fn cycle(scene: &SceneDesc, stack: &[(ObjectId, Vec<ObjectId>, usize)], again: ObjectId) -> Error {
    let label = |id: ObjectId| {
        let object = scene.object(id);
        if object.id.is_empty() { format!("<{}>", object.category.tag()) } else { object.id.clone() }
    };
    let from = stack.iter().position(|(id, ..)| *id == again).unwrap_or(0);
    let mut names: Vec<String> = stack[from..].iter().map(|(id, ..)| label(*id)).collect();
    names.push(label(again));
    scene.error(scene.object(again).pos, format!("the object refers to itself: {}", names.join(" → ")))
}
