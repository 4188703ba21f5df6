//! Faults of an input document: what, where, and what to do; as plain lines or with a caret.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use miette::{
    Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteError,
    MietteSpanContents, SourceCode, SourceSpan, SpanContents,
};

use super::message_text::{commands, escaped, shown_path, visible};

/// Faults beyond this many are counted, not shown.
pub(super) const SHOWN_MAX: usize = 100;

/// A source with a longer line is never quoted (bytes).
const QUOTED_LINE_MAX: usize = 1000;

/// Whether a fault refuses the document.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// The document is refused.
    Error,
    /// The document is read as it is.
    Warning,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Error => "error",
            Self::Warning => "warning",
        })
    }
}

/// One thing that is wrong, or looks wrong, in a document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Error or warning.
    pub severity: Severity,
    /// Dotted path of the key, like `coil.inner_diameter_mm`; empty for the document itself.
    pub key: String,
    /// Expectation and result.
    pub message: String,
    /// Advice.
    pub help: Option<String>,
    /// Its bytes in the source text; `None` where there is no text.
    pub span: Option<Range<usize>>,
}

impl Fault {
    /// An error at `key` with `message`.
    #[must_use]
    pub fn error(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            key: key.into(),
            message: message.into(),
            help: None,
            span: None,
        }
    }

    /// A warning at `key` with `message`.
    #[must_use]
    pub fn warning(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            ..Self::error(key, message)
        }
    }

    /// The same fault at `span`.
    #[must_use]
    pub fn at(mut self, span: &Range<usize>) -> Self {
        self.span = Some(span.clone());
        self
    }

    /// The same fault with advice.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.key.is_empty() {
            write!(f, "{}: ", self.key)?;
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for Fault {}

impl Diagnostic for Fault {
    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.severity {
            Severity::Error => miette::Severity::Error,
            Severity::Warning => miette::Severity::Warning,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = self.help.as_ref()?;
        Some(Box::new(help))
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let span = self.span.as_ref()?;
        let label = LabeledSpan::new(Some("here".to_owned()), span.start, span.len());
        Some(Box::new(std::iter::once(label)))
    }
}

/// A place in a text, counted from 1; columns are characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
}

/// The place of byte `offset` in `text`; past the end, the end.
#[must_use]
pub fn place_of(text: &str, offset: usize) -> Place {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let line_start = before
        .iter()
        .rposition(|&b| b == b'\n')
        .map_or(0, |i| i + 1);
    // Continuation bytes (10xxxxxx) begin no character.
    let characters = before[line_start..].iter().filter(|&&b| b & 0xC0 != 0x80);
    Place {
        line: before.iter().filter(|&&b| b == b'\n').count() + 1,
        column: characters.count() + 1,
    }
}

/// Every fault found in one document, in the order of the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Faults {
    path: PathBuf,
    source: String,
    list: Vec<Fault>,
}

impl Faults {
    /// The faults of the document `path` with text `source`, sorted by their place.
    #[must_use]
    pub fn new(path: &Path, source: &str, mut list: Vec<Fault>) -> Self {
        for fault in &mut list {
            fault.span = fault.span.take().map(|span| within(source, span));
            // They contain names and values of the document.
            fault.key = escaped(&fault.key, usize::MAX);
            fault.message = visible(&fault.message).into_owned();
            fault.help = fault.help.take().map(|help| visible(&help).into_owned());
        }
        list.sort_by_key(|fault| fault.span.as_ref().map(|span| span.start));
        Self {
            path: path.to_owned(),
            source: source.to_owned(),
            list,
        }
    }

    /// The document's path as it was given.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The faults.
    #[must_use]
    pub fn list(&self) -> &[Fault] {
        &self.list
    }

    /// True when nothing was found.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// True when one of the faults refuses the document.
    #[must_use]
    pub fn has_errors(&self) -> bool {
        self.list.iter().any(|f| f.severity == Severity::Error)
    }

    /// The place of `fault`; `None` where it has no place in the text.
    #[must_use]
    pub fn place(&self, fault: &Fault) -> Option<Place> {
        fault
            .span
            .as_ref()
            .map(|span| place_of(&self.source, span.start))
    }

    /// One line a fault: `path:line:column: error: key: message (help)`.
    #[must_use]
    pub fn plain(&self) -> String {
        let mut lines: Vec<String> = self
            .list
            .iter()
            .take(SHOWN_MAX)
            .map(|f| self.line(f))
            .collect();
        lines.extend(self.left_out());
        lines.join("\n")
    }

    /// Each fault with its line, a caret and the advice, wrapped at `width` columns.
    ///
    /// Falls back to [`Faults::plain`] where the source is unfit for a screen
    /// (control characters, lines over 1000 bytes).
    #[must_use]
    pub fn render(&self, colour: bool, width: usize) -> String {
        if !self.quotable() {
            return self.plain();
        }
        let theme = if colour {
            GraphicalTheme::ascii()
        } else {
            GraphicalTheme::none()
        };
        let handler = GraphicalReportHandler::new_themed(theme)
            .with_links(false)
            .with_width(width.max(20));
        let mut text = String::new();
        if handler
            .render_report(&mut text, &Report::new(self))
            .is_err()
        {
            return self.plain();
        }
        text
    }

    fn quotable(&self) -> bool {
        // A line end of two characters is one; alone, a carriage return hides what is before it.
        let tame = |line: &str| line.len() <= QUOTED_LINE_MAX && !line.contains(commands);
        self.source.lines().all(tame)
    }

    fn line(&self, fault: &Fault) -> String {
        let path = shown_path(&self.path);
        let place = match self.place(fault) {
            Some(place) => format!("{path}:{}:{}", place.line, place.column),
            None => path,
        };
        let help = fault
            .help
            .as_ref()
            .map_or_else(String::new, |h| format!(" ({h})"));
        format!("{place}: {}: {fault}{help}", fault.severity)
    }

    fn left_out(&self) -> Option<String> {
        let rest = self.list.len().checked_sub(SHOWN_MAX).filter(|&n| n > 0)?;
        Some(format!(
            "{}: and {rest} more faults",
            shown_path(&self.path)
        ))
    }

    fn headline(&self) -> String {
        let count = |severity| self.list.iter().filter(|f| f.severity == severity).count();
        let named = |n: usize, what: &str| match n {
            0 => None,
            1 => Some(format!("1 {what}")),
            _ => Some(format!("{n} {what}s")),
        };
        let parts = [
            named(count(Severity::Error), "error"),
            named(count(Severity::Warning), "warning"),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        format!("{}: {}", shown_path(&self.path), parts.join(", "))
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.plain())
    }
}

/// `span` cut to the text and to whole characters.
fn within(text: &str, span: Range<usize>) -> Range<usize> {
    let start = text.floor_char_boundary(span.start.min(text.len()));
    let end = text.ceil_char_boundary(span.end.clamp(start, text.len()));
    start..end
}

/// A document that was refused, with every fault found in it (warnings too).
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{faults}")]
pub struct InvalidDocument {
    /// The faults; at least one is an error.
    pub faults: Faults,
}

impl InvalidDocument {
    /// A document that could not be read at all.
    #[must_use]
    pub fn unreadable(path: &Path, fault: Fault) -> Self {
        Self {
            faults: Faults::new(path, "", vec![fault]),
        }
    }
}

/// The quoted text. Unlike miette's own named source its columns are characters, as in
/// [`Faults::plain`].
#[derive(Debug)]
struct QuotedSource<'a> {
    name: String,
    text: &'a str,
}

impl SourceCode for QuotedSource<'_> {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        lines_before: usize,
        lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let inner = self.text.read_span(span, lines_before, lines_after)?;
        let column = match lines_before {
            0 => place_of(self.text, span.offset()).column - 1,
            _ => inner.column(),
        };
        let name = self.name.clone();
        let (data, line, lines) = (inner.data(), inner.line(), inner.line_count());
        let contents =
            MietteSpanContents::new_named(name, data, *inner.span(), line, column, lines);
        Ok(Box::new(contents))
    }
}

/// Report for miette: a headline, then each fault against the named source.
#[derive(Debug)]
pub struct Report<'a> {
    faults: &'a Faults,
    source: QuotedSource<'a>,
    headline: String,
}

impl<'a> Report<'a> {
    /// The report of `faults`.
    #[must_use]
    pub fn new(faults: &'a Faults) -> Self {
        Self {
            faults,
            source: QuotedSource {
                name: shown_path(&faults.path),
                text: &faults.source,
            },
            headline: faults.headline(),
        }
    }
}

impl fmt::Display for Report<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.headline)
    }
}

impl std::error::Error for Report<'_> {}

impl Diagnostic for Report<'_> {
    fn severity(&self) -> Option<miette::Severity> {
        Some(if self.faults.has_errors() {
            miette::Severity::Error
        } else {
            miette::Severity::Warning
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let rest = self.faults.left_out()?;
        Some(Box::new(rest))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.source)
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        let shown = self.faults.list.iter().take(SHOWN_MAX);
        Some(Box::new(shown.map(|fault| fault as &dyn Diagnostic)))
    }
}
