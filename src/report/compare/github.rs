//! A comparison as annotations of GitHub Actions: workflow commands, a line each.
//!
//! <https://docs.github.com/en/actions/reference/workflow-commands-for-github-actions>

use super::tables::finer;
use super::{Changes, Fate, Line, NAMED_FRAMES};
use skinsplat_table::{Digits, visible};

/// Annotations of one level that GitHub shows per step.
const SHOWN: usize = 10;

/// The annotations: an error per regression or loss, a notice per improvement, a warning per note, and the verdict.
pub fn github(changes: &Changes) -> String {
    let mut text = String::new();
    for (level, bad) in [("error", true), ("notice", false)] {
        let of_level = |line: &&Line| line.fate != Fate::Unchanged && changes.is_bad(line) == bad;
        let lines: Vec<&Line> = changes.lines.iter().filter(of_level).collect();
        // One place is for the verdict, one for what is left out.
        let fit = if lines.len() < SHOWN { lines.len() } else { SHOWN - 2 };
        for line in &lines[..fit] {
            text += &command(level, &title(line), &message(line));
        }
        if lines.len() > fit {
            text += &command(level, "reproduce compare", &format!("{} more like these", lines.len() - fit));
        }
    }
    for note in changes.notes.iter().take(SHOWN) {
        text += &command("warning", "reproduce compare", &note.text);
    }
    let level = if changes.is_good() { "notice" } else { "error" };
    text + &command(level, "reproduce compare", &changes.summary())
}

fn title(line: &Line) -> String {
    format!("{} {}", line.table, line.fate.id())
}

fn message(line: &Line) -> String {
    let at = format!("{} {}", line.sequence, line.variant);
    let Some(metric) = line.metric else {
        return match line.frames.as_slice() {
            [] => format!("{at}: all of it"),
            frames => {
                format!(
                    "{at}: {} frames, {}",
                    frames.len(),
                    frames[..frames.len().min(NAMED_FRAMES)].join(", ")
                )
            }
        };
    };
    let shown = |value: Option<f64>, digits: Digits| {
        value.map_or_else(|| "nothing".to_owned(), |value| digits.show(value))
    };
    let (before, after) = (line.digits_before(metric), finer(metric));
    let numbers =
        format!("{} {} -> {}", line.title(), shown(line.baseline, before), shown(line.current, after));
    let tolerance = line.tolerance.map_or_else(String::new, |t| format!(" (tolerance {t})"));
    format!("{at}: {numbers}{tolerance}{}", line.behind())
}

/// A workflow command: what it says ends no line, starts no other command and moves no cursor.
fn command(level: &str, title: &str, message: &str) -> String {
    let escaped = |text: &str| text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A");
    let data = |text: &str| visible(&escaped(text)).into_owned();
    let property = |text: &str| data(text).replace(':', "%3A").replace(',', "%2C");
    format!("::{level} title={}::{}\n", property(title), data(message))
}

#[cfg(test)]
mod tests {
    #[test]
    fn names_cannot_leave_their_command() {
        let made = super::command("error", "a,b: 5%\n::error::x", "100 %\r\n::stop-commands::y");
        let expected = "::error title=a%2Cb%3A 5%25%0A%3A%3Aerror%3A%3Ax::100 %25%0D%0A::stop-commands::y\n";
        assert_eq!(made, expected);
    }

    #[test]
    fn names_command_no_terminal() {
        let made = super::command("notice", "a\u{1b}[31m", "b\u{202e}c");
        assert_eq!(made, "::notice title=a\\u{1b}[31m::b\\u{202e}c\n");
    }
}
