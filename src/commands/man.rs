//! `man`: the manual pages.

use std::io::{self, Write};
use std::path::PathBuf;
use std::process::{Command, Stdio};

use clap::{Args, CommandFactory};
use clap_mangen::Man as Page;
use serde::Serialize;

use super::Arguments;
use crate::RunError;
use crate::bundle::atomic::{FileSet, Overwrite};
use crate::cli::args::Writing;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::printer::{Printer, Stream, shows_output};
use crate::cli::quantity::count;
use crate::cli::start::folder;
use crate::cli::values::FileArgument;

/// Print the manual page, or write all of them
///
/// Shows the main manual page at a terminal, as `man` does, and prints its source elsewhere; with --out
/// writes it and one page a command into a folder, as fluxform.1, fluxform-calibrate.1 and so on.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Pages, &[
    ("fluxform man > fluxform.1", "the main page; read it with: man ./fluxform.1"),
    ("fluxform man --out man1", "all pages"),
]))]
pub struct Man {
    /// Folder to write all pages to
    #[arg(long, value_name = "DIR")]
    out: Option<FileArgument>,
    #[command(flatten)]
    writing: Writing,
}

/// What was written.
#[derive(Debug, Serialize)]
struct Written {
    folder: PathBuf,
    pages: Vec<String>,
}

impl Man {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let mut command = Arguments::command();
        command.build();
        let Some(out) = &self.out else {
            let main = rendered(&command)?;
            if shows_output() && shown_by_man(&main).is_ok() {
                return Ok(());
            }
            return printer.data(|out| out.write_all(&main));
        };
        let folder = folder(out)?;
        let overwrite = Overwrite::same_bytes(self.writing.force, &[]);
        let mut set = FileSet::begin(&folder, overwrite);
        let mut pages = vec![("fluxform.1".to_owned(), rendered(&command)?)];
        add_pages(&command, &mut pages)?;
        for (name, text) in &pages {
            set.write(name, |out| out.write_all(text))
                .map_err(RunError::from)?;
        }
        set.commit().map_err(RunError::from)?;
        let written = Written {
            folder,
            pages: pages.into_iter().map(|(name, _)| name).collect(),
        };
        printer.summary(Stream::Output, &written, || {
            format!(
                "{}: {}\n",
                written.folder.display(),
                count(written.pages.len(), "page")
            )
        })
    }
}

/// Shows a page as the system's `man` does.
fn shown_by_man(page: &[u8]) -> io::Result<()> {
    let mut viewer = Command::new("man")
        .args(["-l", "-"])
        .stdin(Stdio::piped())
        .spawn()?;
    if let Some(mut input) = viewer.stdin.take() {
        // A reader who leaves early closes the pipe.
        let _ = input.write_all(page);
    }
    match viewer.wait()?.success() {
        true => Ok(()),
        false => Err(io::Error::other("man does not show the page")),
    }
}

/// Adds the pages of the commands below `command`.
fn add_pages(command: &clap::Command, pages: &mut Vec<(String, Vec<u8>)>) -> io::Result<()> {
    for sub in command.get_subcommands() {
        // Building gave it the name of its page.
        let name = sub.get_display_name().unwrap_or(sub.get_name());
        pages.push((format!("{name}.1"), rendered(sub)?));
        add_pages(sub, pages)?;
    }
    Ok(())
}

fn rendered(command: &clap::Command) -> io::Result<Vec<u8>> {
    let mut text = Vec::new();
    // Of what the short help leaves out the page would have the names alone.
    let whole = command.clone().mut_args(|arg| arg.hide_short_help(false));
    Page::new(whole).render(&mut text)?;
    Ok(text)
}
