//! Text in lines that a narrow terminal shows whole.

/// Columns that every terminal has.
pub(crate) const WIDTH: usize = 80;

/// Breaks lines longer than [`WIDTH`] at blanks; what follows stands below the value that the line
/// gives, or two columns in. A word longer than a line, such as a path, stays whole.
pub(crate) fn fit(text: &str) -> String {
    let lines: Vec<String> = text.lines().map(fit_line).collect();
    lines.join("\n")
}

fn fit_line(line: &str) -> String {
    if line.chars().count() <= WIDTH {
        return line.to_owned();
    }
    let words = line.trim_start();
    let indent = line.chars().count() - words.chars().count();
    let hang = hang(words, indent);
    let mut fitted = String::new();
    let mut column = 0;
    for piece in words.split_inclusive(' ') {
        let length = piece.trim_end().chars().count();
        if column == 0 {
            fitted.extend(std::iter::repeat_n(' ', indent));
            column = indent;
        } else if column + length > WIDTH && column > hang {
            fitted.truncate(fitted.trim_end().len());
            fitted.push('\n');
            fitted.extend(std::iter::repeat_n(' ', hang));
            column = hang;
        }
        fitted.push_str(piece);
        column += piece.chars().count();
    }
    fitted
}

/// Where the value begins in `  name      value`, else two columns in.
fn hang(words: &str, indent: usize) -> usize {
    let gap = words.find("  ").map(|at| {
        let blanks = words[at..].chars().take_while(|c| *c == ' ').count();
        indent + words[..at].chars().count() + blanks
    });
    gap.filter(|column| *column <= WIDTH / 2).unwrap_or(indent + 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_lines_stay_and_long_ones_break_below_their_value() {
        let text = format!("head\n  name      {}", "word ".repeat(30).trim_end());
        let fitted = fit(&text);
        let lines: Vec<&str> = fitted.lines().collect();
        assert_eq!(lines.len(), 4, "{fitted}");
        assert_eq!(lines[0], "head");
        assert!(lines[1].starts_with("  name      word") && lines[2].starts_with("            word"));
        assert!(lines.iter().all(|line| line.chars().count() <= WIDTH && !line.ends_with(' ')));
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&fitted), words(&text), "no word is lost");
    }

    #[test]
    fn a_path_longer_than_a_line_stays_whole() {
        let path = format!("/{}", "x".repeat(100));
        assert_eq!(fit(&format!("cannot write {path} now")), format!("cannot write\n  {path}\n  now"));
    }
}
