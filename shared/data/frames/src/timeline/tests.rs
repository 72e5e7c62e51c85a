use super::*;

const MS: i64 = 1_000_000;

/// Images at the given milliseconds, recorded every 33 ms.
fn stream(millis: &[i64]) -> Vec<RecordedImage> {
    let log = |at: usize| Some(1_700_000_000_000 * MS + at as i64 * 33 * MS);
    millis
        .iter()
        .enumerate()
        .map(|(at, stamp)| RecordedImage {
            stamp_nanos: stamp * MS,
            log_nanos: log(at),
            ordinal: 2 * at as u64,
        })
        .collect()
}

fn without_log(millis: &[i64]) -> Vec<RecordedImage> {
    stream(millis).into_iter().map(|image| RecordedImage { log_nanos: None, ..image }).collect()
}

fn check(millis: &[i64], expected: &[i64], order: &[usize], words: &[&str]) {
    let depth = stream(millis);
    let colour: Vec<RecordedImage> =
        depth.iter().map(|image| RecordedImage { ordinal: image.ordinal + 1, ..*image }).collect();
    let found = timelines(&depth, &colour, ["/depth", "/rgb"]);
    let expected: Vec<i64> = expected.iter().map(|stamp| stamp * MS).collect();
    assert_eq!((&found.depth.stamps_nanos, &found.depth.order[..]), (&expected, order), "{found:?}");
    assert_eq!(found.depth, found.colour, "colour goes with depth");
    let text = found.sentences.join("\n");
    for word in words {
        assert!(text.contains(word), "{text} lacks {word}");
    }
    assert_eq!(words.is_empty(), text.is_empty(), "{text}");
}

#[test]
fn stamps_that_rise_are_kept_whatever_their_gaps() {
    check(&[0, 33, 66, 99], &[0, 33, 66, 99], &[0, 1, 2, 3], &[]);
    let paused = without_log(&[10, 43, 5000, 5033]);
    let found = timelines(&paused, &[], ["d", "c"]);
    assert_eq!((found.depth.stamps_nanos[2], found.sentences.len()), (5000 * MS, 0));
    let stamps = [10, 43, 76, 90_000, 90_033].map(|stamp| stamp * MS);
    assert_eq!(
        long_pause(&stamps).unwrap(),
        "90 s pass between frames 2 and 3, far more than between the others"
    );
    assert_eq!((long_pause(&stamps[..3]), long_pause(&[])), (None, None));
}

#[test]
fn a_clock_that_is_set_back_begins_a_new_stretch() {
    let word = ["/depth: the stamps go back by 0.099 s at image 5"];
    check(
        &[100, 133, 166, 199, 100, 133, 166],
        &[100, 133, 166, 199, 232, 265, 298],
        &[0, 1, 2, 3, 4, 5, 6],
        &word,
    );
    // By a little more than an interval, so that both stretches would interleave.
    check(
        &[100, 133, 166, 199, 149, 182, 215, 248],
        &[100, 133, 166, 199, 232, 265, 298, 331],
        &[0, 1, 2, 3, 4, 5, 6, 7],
        &["go back by 0.050 s at image 5"],
    );
    // A bag that was played three times.
    check(
        &[7, 40, 73, 7, 40, 73, 7, 40, 73],
        &[7, 40, 73, 106, 139, 172, 205, 238, 271],
        &[0, 1, 2, 3, 4, 5, 6, 7, 8],
        &["image 4", "image 7"],
    );
}

#[test]
fn a_clock_that_is_set_ahead_is_told_from_a_pause_by_the_times_of_recording() {
    let words = ["jump ahead by 9.901 s at image 4"];
    check(&[33, 66, 99, 10_000, 10_033], &[33, 66, 99, 132, 165], &[0, 1, 2, 3, 4], &words);
}

#[test]
fn an_image_that_came_late_is_put_where_it_belongs() {
    check(
        &[0, 33, 99, 66, 132, 165, 198, 231],
        &[0, 33, 66, 99, 132, 165, 198, 231],
        &[0, 1, 3, 2, 4, 5, 6, 7],
        &["1 images came late"],
    );
}

#[test]
fn repeated_images_are_left_out_and_counted() {
    check(&[0, 33, 33, 66, 99, 132], &[0, 33, 66, 99, 132], &[0, 1, 3, 4, 5], &["1 messages repeat a time"]);
}

#[test]
fn stamps_that_are_not_set_are_replaced_by_the_times_of_recording() {
    let log = 1_700_000_000_000;
    let words = ["/depth: 4 of 4 stamps are not set", "the times of recording are used"];
    check(&[0; 4], &[log, log + 33, log + 66, log + 99], &[0, 1, 2, 3], &words);
    let words = ["3 of 4 stamps are equal to the one before"];
    check(&[1000; 4], &[log, log + 33, log + 66, log + 99], &[0, 1, 2, 3], &words);
    let found = timelines(&without_log(&[0; 3]), &[], ["d", "c"]);
    assert_eq!(found.depth.stamps_nanos, [0, USUAL_INTERVAL_NANOS, 2 * USUAL_INTERVAL_NANOS]);
    assert!(found.sentences[0].contains("30 frames a second are assumed"), "{found:?}");
    check(
        &[0, 50_033, 0, 50_099, 50_132],
        &[50_000, 50_033, 50_066, 50_099, 50_132],
        &[0, 1, 2, 3, 4],
        &["2 of 5 stamps are not set"],
    );
}

#[test]
fn a_stream_without_stamps_has_those_of_the_other() {
    let usable = [5000, 5033, 5066, 5099];
    for is_logged in [true, false] {
        let of = |millis: &[i64]| if is_logged { stream(millis) } else { without_log(millis) };
        let found = timelines(&of(&usable), &of(&[0; 4]), ["depth.txt", "rgb.txt"]);
        assert_eq!(found.depth.stamps_nanos, usable.map(|stamp| stamp * MS), "{found:?}");
        assert_eq!(found.colour, found.depth, "{found:?}");
        assert_eq!(found.sentences, ["rgb.txt: 4 of 4 stamps are not set: the times of depth.txt are used"]);
        let found = timelines(&of(&[7; 4]), &of(&usable), ["depth.txt", "rgb.txt"]);
        assert_eq!(found.depth.stamps_nanos, usable.map(|stamp| stamp * MS), "{found:?}");
        assert_eq!(found.colour, found.depth, "{found:?}");
    }
    // Between two images and behind the last, by the time of recording; where the clock was set back too.
    let depth = stream(&[5000, 5033, 4000, 4033]);
    let mut colour = stream(&[0; 5]);
    colour.iter_mut().for_each(|image| image.log_nanos = image.log_nanos.map(|log| log + 11 * MS));
    let found = timelines(&depth, &colour, ["d", "c"]);
    assert_eq!(found.depth.stamps_nanos, [5000, 5033, 5066, 5099].map(|stamp| stamp * MS));
    assert_eq!(
        found.colour.stamps_nanos,
        [5011, 5033, 5077, 5110, 5143].map(|stamp| stamp * MS),
        "{found:?}"
    );
}

#[test]
fn a_list_without_any_order_is_sorted() {
    let millis: Vec<i64> = (0..40).map(|k| (k * 17 % 40) * 33).collect();
    let found = timelines(&without_log(&millis), &[], ["depth.txt", "rgb.txt"]);
    assert_eq!(found.depth.stamps_nanos, (0..40).map(|k| k * 33 * MS).collect::<Vec<i64>>());
    assert!(found.sentences[0].contains("sorted by time") && !found.has_new_stretch, "{found:?}");
}

#[test]
fn colour_of_another_rate_goes_into_the_stretch_of_its_depth() {
    let depth = stream(&[7, 40, 73, 106, 7, 40, 73, 106]);
    let colour: Vec<RecordedImage> =
        depth.iter().step_by(2).map(|image| RecordedImage { ordinal: image.ordinal + 1, ..*image }).collect();
    let found = timelines(&depth, &colour, ["d", "c"]);
    assert_eq!(found.colour.stamps_nanos, [7 * MS, 73 * MS, 139 * MS, 205 * MS]);
    // A single colour image in the second stretch.
    let found = timelines(&depth, &colour[..3], ["d", "c"]);
    assert_eq!(found.colour.stamps_nanos, [7 * MS, 73 * MS, 139 * MS]);
}
