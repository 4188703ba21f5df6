//! The documents and their parts.

/// Documents for users, each with a title.
pub const PAGES: [&str; 8] = [
    "README.md",
    "CONTRIBUTING.md",
    "designs/README.md",
    "designs/first_display.md",
    "designs/troubleshooting.md",
    "results/README.md",
    "shapes/README.md",
    "tests/README.md",
];

pub fn page(name: &str) -> String {
    fluxform_testing::committed(name)
}

/// The text of the section of that title, in whichever document it is.
pub fn section(title: &str) -> String {
    let heading = format!("\n## {title}\n");
    let mut found = PAGES
        .iter()
        .filter_map(|name| Some(page(name).split_once(&heading)?.1.to_owned()));
    let rest = found
        .next()
        .unwrap_or_else(|| panic!("no document has a section {title:?}"));
    assert!(
        found.next().is_none(),
        "two documents have a section {title:?}"
    );
    rest.split("\n## ").next().unwrap().to_owned()
}

/// A fenced block: its language, its text, and the last line of words before it.
pub struct Block {
    pub language: String,
    pub text: String,
    pub before: String,
}

pub fn blocks(section: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut before = String::new();
    let mut lines = section.lines();
    while let Some(line) = lines.next() {
        if let Some(language) = line.strip_prefix("```") {
            let inside: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
            blocks.push(Block {
                language: language.to_owned(),
                text: inside.join("\n") + "\n",
                before: std::mem::take(&mut before),
            });
        } else if !line.is_empty() {
            before = line.to_owned();
        }
    }
    blocks
}

/// The first command of a section without the program's name, and the output shown after it.
pub fn command_and_output(title: &str) -> (String, String) {
    let blocks = blocks(&section(title));
    let first = blocks
        .iter()
        .position(|block| block.language == "sh")
        .unwrap();
    let command = blocks[first].text.trim_end().to_owned();
    let shown = blocks[first + 1..]
        .iter()
        .find(|block| block.language == "text");
    (command, shown.unwrap().text.clone())
}

/// The lines without the folder that was written to and without the times of this machine; that a time is shown counts.
pub fn lasting(text: &str) -> Vec<String> {
    text.lines()
        .map(str::trim_end)
        .filter(|line| !line.trim_start().starts_with("written to"))
        .map(
            |line| match line.split_whitespace().collect::<Vec<_>>()[..] {
                ["took", _, _] => "  took".to_owned(),
                ["step", _, _, "each", "on", "this", "machine"] => {
                    "  step each on this machine".to_owned()
                }
                _ => line.to_owned(),
            },
        )
        .collect()
}
