//! What the geometry's reader could not survive: it recurses into brackets and along references.

use std::collections::HashMap;

/// Brackets nested deeper than this belong to no STEP file (points of a surface: three).
const DEEPEST_BRACKETS: usize = 32;
/// A chain of references from a product down to a coordinate has about twenty links.
const LONGEST_CHAIN: usize = 200;

/// Refuses what leads a recursive reader down without end.
pub(super) fn check(text: &str) -> Result<(), String> {
    let mut statements: HashMap<u64, Vec<u64>> = HashMap::new();
    let mut open: Option<u64> = None;
    let mut depth = 0usize;
    let mut quoted = false;
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        let byte = bytes[at];
        at += 1;
        match byte {
            b'\'' => quoted = !quoted,
            _ if quoted => {}
            b'(' => {
                depth += 1;
                if depth > DEEPEST_BRACKETS {
                    return Err(format!(
                        "its brackets are nested more than {DEEPEST_BRACKETS} deep"
                    ));
                }
            }
            b')' => depth = depth.saturating_sub(1),
            b';' => {
                open = None;
                depth = 0;
            }
            b'#' => {
                let digits = bytes[at..].iter().take_while(|b| b.is_ascii_digit());
                let digits = digits.count();
                let id = text[at..at + digits].parse().ok();
                at += digits;
                match (open, id) {
                    (None, Some(id)) => {
                        open = Some(id);
                        statements.entry(id).or_default();
                    }
                    (Some(own), Some(id)) => statements.entry(own).or_default().push(id),
                    (_, None) => {}
                }
            }
            _ => {}
        }
    }
    follow(&statements)
}

/// How far below a statement its references lead.
#[derive(Clone, Copy)]
enum Depth {
    Open,
    Known(usize),
}

/// Follows all references without recursion.
fn follow(statements: &HashMap<u64, Vec<u64>>) -> Result<(), String> {
    let mut depths: HashMap<u64, Depth> = HashMap::with_capacity(statements.len());
    for start in statements.keys() {
        if depths.contains_key(start) {
            continue;
        }
        depths.insert(*start, Depth::Open);
        // A statement, which of its references comes next, and the deepest so far.
        let mut path = vec![(*start, 0, 0)];
        while let Some((id, next, deepest)) = path.last_mut() {
            let Some(reference) = statements[id].get(*next) else {
                let depth = *deepest + 1;
                if depth > LONGEST_CHAIN {
                    return Err(format!(
                        "a chain of its references is longer than {LONGEST_CHAIN}"
                    ));
                }
                depths.insert(*id, Depth::Known(depth));
                path.pop();
                if let Some((_, next, deepest)) = path.last_mut() {
                    *next += 1;
                    *deepest = depth.max(*deepest);
                }
                continue;
            };
            match (depths.get(reference), statements.contains_key(reference)) {
                (Some(Depth::Open), _) => {
                    return Err(format!("statement #{reference} refers to itself"));
                }
                (Some(Depth::Known(depth)), _) => {
                    *deepest = (*deepest).max(*depth);
                    *next += 1;
                }
                (None, true) => {
                    depths.insert(*reference, Depth::Open);
                    let reference = *reference;
                    path.push((reference, 0, 0));
                }
                (None, false) => *next += 1,
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_that_end_are_followed() {
        let good = "#1=A('(((#1;',#2,#3);\n#2=B((#4,#9));#3=B(#4);#4=C(*);";
        assert_eq!(check(good), Ok(()));
        let chain: String = (1..150).map(|k| format!("#{k}=A(#{});", k + 1)).collect();
        assert_eq!(check(&chain), Ok(()));
    }

    #[test]
    fn references_that_do_not_end_are_refused() {
        let refused = |text: &str, said: &str| {
            let what = check(text).unwrap_err();
            assert!(what.contains(said), "{what}");
        };
        refused("#1=A(#1);", "#1 refers to itself");
        refused("#1=A(#2);#2=B(#3);#3=C(#2);", "refers to itself");
        let chain: String = (1..300).map(|k| format!("#{k}=A(#{});", k + 1)).collect();
        refused(&chain, "longer than 200");
        refused(
            &format!("#1=A({}", "(".repeat(100_000)),
            "nested more than 32",
        );
    }
}
