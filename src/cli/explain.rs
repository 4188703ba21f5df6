//! `--explain`: what an error code means, what causes it and what to do.

use serde::Serialize;

use super::code::Code;
use super::failure::Failure;
use super::layout::table;
use super::printer::{Printer, Stream};

/// The codes to be explained.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ExplainTarget {
    /// Every code, a line each.
    List,
    /// These, in full.
    Codes(Vec<Code>),
}

/// `list`, a code like `E301` in upper or lower case, or an exit code like `3` for all of its codes.
///
/// # Errors
/// Anything else.
pub fn target(text: &str) -> Result<ExplainTarget, String> {
    if text == "list" {
        return Ok(ExplainTarget::List);
    }
    let meant = |code: &Code| {
        code.name().eq_ignore_ascii_case(text) || code.exit_code().to_string() == text
    };
    let codes: Vec<Code> = Code::ALL.into_iter().filter(meant).collect();
    if codes.is_empty() {
        let names: Vec<&str> = Code::ALL.iter().map(|code| code.name()).collect();
        return Err(format!(
            "expected list, the exit code of a failure or one of {}",
            names.join(", ")
        ));
    }
    Ok(ExplainTarget::Codes(codes))
}

#[derive(Serialize)]
struct Explained {
    codes: Vec<Explanation>,
}

#[derive(Serialize)]
struct Explanation {
    code: &'static str,
    exit_code: u8,
    meaning: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    explanation: Option<&'static str>,
}

/// Prints what is target for.
///
/// # Errors
/// Standard output that takes no more.
pub fn run(target: &ExplainTarget, printer: &Printer) -> Result<(), Failure> {
    let (codes, full) = match target {
        ExplainTarget::List => (&Code::ALL[..], false),
        ExplainTarget::Codes(codes) => (&codes[..], true),
    };
    if printer.json() {
        let codes = codes.iter().map(|code| Explanation {
            code: code.name(),
            exit_code: code.exit_code(),
            meaning: code.meaning(),
            explanation: full.then(|| code.explanation()),
        });
        let explained = Explained {
            codes: codes.collect(),
        };
        return printer.summary(Stream::Output, &explained, String::new);
    }
    let text = if full { pages(codes) } else { list(codes) };
    printer.data(|out| out.write_all(text.as_bytes()))
}

fn list(codes: &[Code]) -> String {
    let head = ["code", "exit", "meaning"].map(str::to_owned).to_vec();
    let row = |code: &Code| {
        let exit = code.exit_code().to_string();
        vec![code.name().to_owned(), exit, code.meaning().to_owned()]
    };
    let rows: Vec<_> = std::iter::once(head).chain(codes.iter().map(row)).collect();
    table("lrl", &rows)
}

fn pages(codes: &[Code]) -> String {
    let page = |code: &Code| {
        format!(
            "{}: {} (exit code {})\n\n{}\n",
            code.name(),
            code.meaning(),
            code.exit_code(),
            code.explanation()
        )
    };
    codes.iter().map(page).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::{Code, ExplainTarget, target};

    #[test]
    fn codes_are_found_by_name_and_by_exit_code() {
        assert_eq!(target("list"), Ok(ExplainTarget::List));
        assert_eq!(
            target("e402"),
            Ok(ExplainTarget::Codes(vec![Code::NoForceConstant]))
        );
        let Ok(ExplainTarget::Codes(codes)) = target("5") else {
            panic!("5 is an exit code");
        };
        assert_eq!(codes, [Code::Check, Code::Damaged]);
        assert_eq!(
            target("130"),
            Ok(ExplainTarget::Codes(vec![Code::Interrupted]))
        );
        assert!(target("E999").unwrap_err().contains("E301"));
    }
}
