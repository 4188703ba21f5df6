//! Markup as text: what comes from an input can never become a tag, an attribute or a script.

/// Markup that grows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Html(String);

impl Html {
    /// The markup.
    #[must_use]
    pub fn finish(self) -> String {
        self.0
    }

    /// Adds markup of ours.
    pub fn raw(&mut self, markup: &str) -> &mut Self {
        self.0.push_str(markup);
        self
    }

    /// Adds a text, escaped.
    pub fn text(&mut self, text: &str) -> &mut Self {
        push_escaped(&mut self.0, text);
        self
    }

    /// Adds `<open>text</name>`; `open` is a name of ours and its attributes.
    pub fn element(&mut self, open: &str, text: &str) -> &mut Self {
        let name = open.split(' ').next().unwrap_or(open);
        self.raw("<").raw(open).raw(">").text(text);
        self.raw("</").raw(name).raw(">")
    }

    /// Adds a table; wide ones scroll on their own.
    pub fn table(&mut self, table: &Table) -> &mut Self {
        self.raw("<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"")
            .text(&table.caption)
            .raw(if table.prose {
                "\"><table class=\"prose\"><caption>"
            } else {
                "\"><table><caption>"
            })
            .text(&table.caption)
            .raw("</caption><thead><tr>");
        for (head, numeric) in &table.head {
            let open = if *numeric {
                "th scope=\"col\" class=\"n\""
            } else {
                "th scope=\"col\""
            };
            self.element(open, head);
        }
        self.raw("</tr></thead><tbody>");
        // Where several numbers follow each other, each needs its name once the head is gone.
        let named = table.prose && table.head.iter().filter(|(_, numeric)| *numeric).count() > 1;
        for row in &table.rows {
            self.raw("<tr>");
            for (at, cell) in row.iter().enumerate() {
                let numeric = table.head.get(at).is_some_and(|(_, numeric)| *numeric);
                match (cell, numeric) {
                    (Cell::Markup(markup), _) => {
                        self.raw("<td class=\"m\">").raw(markup).raw("</td>");
                    }
                    (Cell::Text(text), true) if named => {
                        self.raw("<td class=\"n\" data-head=\"")
                            .text(table.head[at].0)
                            .raw("\">")
                            .text(text)
                            .raw("</td>");
                    }
                    (Cell::Text(text), true) => {
                        self.element("td class=\"n\"", text);
                    }
                    (Cell::Text(text), false) if at == 0 => {
                        self.element("th scope=\"row\"", text);
                    }
                    (Cell::Text(text), false) => {
                        self.element("td", text);
                    }
                }
            }
            self.raw("</tr>");
        }
        self.raw("</tbody></table></div>")
    }

    /// Adds a table that is folded away behind its caption.
    pub fn folded_table(&mut self, table: &Table) -> &mut Self {
        self.raw("<details>")
            .element("summary", &table.caption)
            .table(table)
            .raw("</details>")
    }
}

/// A table.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Table {
    /// Its subject.
    pub caption: String,
    /// Heads of the columns, and whether a column holds numbers.
    pub head: Vec<(&'static str, bool)>,
    /// Row by row.
    pub rows: Vec<Vec<Cell>>,
    /// Whether the last column is prose, which is placed below its row on a narrow screen.
    pub prose: bool,
}

/// A cell of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Cell {
    /// Escaped when it is written.
    Text(String),
    /// Markup of ours, without any text of an input.
    Markup(String),
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// `text` as it may appear in an element or in a quoted attribute.
#[must_use]
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    push_escaped(&mut out, text);
    out
}

fn push_escaped(out: &mut String, text: &str) {
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Neither HTML nor a reader knows them, and some hide what follows.
            c if c.is_control() && c != '\n' && c != '\t' => out.push('\u{fffd}'),
            '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_becomes_markup() {
        let hostile = "</script><img src=x onerror=\"alert('1')\">&amp;\u{0}\u{202e}";
        let safe = escaped(hostile);
        assert!(!safe.contains(['<', '>', '"', '\'', '\u{0}', '\u{202e}']));
        assert!(safe.contains("&lt;/script&gt;&lt;img") && safe.contains("&amp;amp;"));
        let mut html = Html::default();
        html.element("p class=\"note\"", hostile);
        assert_eq!(html.finish(), format!("<p class=\"note\">{safe}</p>"));
    }

    #[test]
    fn a_table_marks_heads_and_kinds() {
        let mut html = Html::default();
        html.table(&Table {
            caption: "a < b".to_owned(),
            head: vec![("coil", false), ("I / A", true)],
            rows: vec![vec!["<0>".into(), "0.7".into()]],
            prose: false,
        });
        let text = html.finish();
        assert!(text.contains("<caption>a &lt; b</caption>"));
        assert!(text.contains("<th scope=\"row\">&lt;0&gt;</th><td class=\"n\">0.7</td>"));
    }
}
