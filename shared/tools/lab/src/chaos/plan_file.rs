//! An exact plan of faults: one line each, `STAGE INDEX POINT FAULT`.

use std::path::Path;
use tessera_messages::Stage;
use tessera_outputs::ToolError;
use tessera_stage::{KILL_POINTS, MESSAGE_POINTS, fault_names};

/// Reads a plan.
///
/// # Errors
/// Names the file, and the line that is wrong.
pub(super) fn read(path: &Path) -> Result<(String, u64), ToolError> {
    let wrong = |problem: String| ToolError::Arguments(format!("{}: {problem}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
    parse(&text).map_err(wrong)
}

/// Turns a plan's text into what `--faults` takes, and says how many faults there are.
///
/// # Errors
/// Names the line, what it says and what was expected.
fn parse(text: &str) -> Result<(String, u64), String> {
    let (mut words, mut n) = (Vec::new(), 0);
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        words.push(parse_line(line).map_err(|problem| format!("line {}: {problem}", number + 1))?);
        n += 1;
    }
    if n == 0 {
        Err("no fault in it, expected lines of STAGE INDEX POINT FAULT".into())
    } else {
        Ok((words.join(";"), n))
    }
}

fn parse_line(line: &str) -> Result<String, String> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let [stage, index, point, fault] = fields[..] else {
        return Err(format!("{line:?} has {} words, expected STAGE INDEX POINT FAULT", fields.len()));
    };
    if Stage::from_name(stage).is_none() {
        let names = Stage::ALL.map(Stage::name).join(", ");
        return Err(format!("stage is {stage:?}, expected one of {names}"));
    }
    let points: Vec<&str> = KILL_POINTS.iter().filter(|(of, _)| *of == stage).map(|(_, p)| *p).collect();
    if !points.contains(&point) {
        return Err(format!("kill point of {stage} is {point:?}, expected one of {}", points.join(", ")));
    }
    if index.parse::<u64>().is_err() {
        return Err(format!("index is {index:?}, expected a frame (for optimise, a request) number"));
    }
    if !fault_names().any(|known| known == fault) {
        let names = fault_names().collect::<Vec<_>>().join(", ");
        return Err(format!("fault is {fault:?}, expected one of {names}"));
    }
    if matches!(fault, "drop" | "corrupt" | "index-jump") && !MESSAGE_POINTS.contains(&(stage, point)) {
        let places = MESSAGE_POINTS.map(|(stage, point)| format!("{stage} {point}")).join(" and ");
        return Err(format!("{fault} works where a message is about to be sent: {places}"));
    }
    Ok(format!("{stage}={point}:{index}:{fault}+"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_become_words_of_the_kill_plan() {
        let text = "# two faults\nalign 12 stored kill\n\nsensor 3 read drop # lost\n";
        assert_eq!(parse(text).unwrap(), ("align=stored:12:kill+;sensor=read:3:drop+".to_owned(), 2));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let cases = [
            ("\nalign 12 stored", "line 2: \"align 12 stored\" has 3 words"),
            ("aligner 12 stored kill", "stage is \"aligner\", expected one of sensor"),
            ("align 12 sent kill", "kill point of align is \"sent\", expected one of opened"),
            ("align x stored kill", "index is \"x\""),
            ("align 1 stored burn", "fault is \"burn\", expected one of kill"),
            ("align 1 stored drop", "drop works where a message is about to be sent: sensor read"),
            ("# nothing", "no fault in it"),
        ];
        for (text, expected) in cases {
            let message = parse(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
