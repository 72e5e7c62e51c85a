use super::*;

const START: i64 = 1_700_000_000_000_000_000;

/// Sixty names at 30 frames a second.
fn names(name: impl Fn(i64, i64) -> String) -> Vec<String> {
    (0..60).map(|k| name(k, START + (k * 1_000_000_000 + 15) / 30)).collect()
}

fn meaning_of(names: &[String]) -> Result<NameMeaning, String> {
    let stems: Vec<&str> = names.iter().map(String::as_str).collect();
    understand(&stems, false).map(|understood| {
        assert_eq!((understood.kept.len(), &understood.warning), (names.len(), &None));
        understood.meaning
    })
}

/// Times that are those of the names to `within` nanoseconds, from an offset on.
fn check_times(names: &[String], offset: i64, within: i64) {
    let Ok(NameMeaning::Times(times, _)) = meaning_of(names) else { panic!("{:?}", meaning_of(names)) };
    assert_eq!(times.len(), 60);
    for (k, time) in (0..).zip(&times) {
        let expected = START + (k * 1_000_000_000 + 15) / 30 - offset;
        assert!((time - expected).abs() <= within, "{}: {time}, expected {expected}", names[k as usize]);
    }
}

#[test]
fn times_since_1970_are_known_by_their_digits() {
    check_times(&names(|_, t| format!("{}.{:06}", t / 1_000_000_000, t % 1_000_000_000 / 1000)), 0, 1000);
    check_times(
        &names(|_, t| format!("{}.{:04}", t / 1_000_000_000, t % 1_000_000_000 / 100_000)),
        0,
        100_000,
    );
    check_times(&names(|_, t| format!("{}_{:09}", t / 1_000_000_000, t % 1_000_000_000)), 0, 0);
    check_times(&names(|_, t| format!("{}-{}", t / 1_000_000_000, t % 1_000_000_000)), 0, 0);
    check_times(&names(|_, t| format!("{}.{}", t / 1_000_000_000, t % 1_000_000_000)), 0, 0);
    check_times(
        &names(|_, t| format!("{}_{:03}", t / 1_000_000_000, t % 1_000_000_000 / 1_000_000)),
        0,
        1_000_000,
    );
    check_times(&names(|_, t| t.to_string()), 0, 0);
    check_times(&names(|_, t| (t / 1000).to_string()), 0, 1000);
    check_times(&names(|_, t| (t / 1_000_000).to_string()), 0, 1_000_000);
    check_times(&names(|_, t| format!("depth_{t}_cam0")), 0, 0);
    check_times(
        &names(|k, t| format!("{k:06}-{}.{:06}", t / 1_000_000_000, t % 1_000_000_000 / 1000)),
        0,
        1000,
    );
    check_times(&names(|k, t| format!("{k}_{t}")), 0, 0);
}

/// From 22:13:20: over the end of a minute too, where seconds alone would go back.
#[test]
fn dates_are_times() {
    let date = |t: i64| {
        let of_day = (t / 1_000_000_000) % 86_400;
        [of_day / 3600, of_day / 60 % 60, of_day % 60].map(|part| format!("{part:02}"))
    };
    for far in [0, 39] {
        let names = |form: fn(&[String; 3], i64) -> String| {
            names(|_, t| form(&date(t + far * 1_000_000_000), t % 1_000_000_000))
        };
        let from = -far * 1_000_000_000;
        check_times(
            &names(|[h, m, s], n| format!("20231114_{h}{m}{s}_{:03}", n / 1_000_000)),
            from,
            1_000_000,
        );
        check_times(
            &names(|[h, m, s], n| format!("depth_2023-11-14T{h}-{m}-{s}.{:06}", n / 1000)),
            from,
            1000,
        );
        check_times(&names(|[h, m, s], n| format!("20231114{h}{m}{s}{:03}", n / 1_000_000)), from, 1_000_000);
        check_times(&names(|[h, m, s], n| format!("7_2023.11.14_{h}.{m}.{s}.{n:09}")), from, 0);
    }
    // What cannot be a date is none.
    let numbers = meaning_of(&names(|k, _| format!("20231314_{:06}", k))).unwrap();
    assert!(matches!(numbers, NameMeaning::Numbers(_)), "{numbers:?}");
}

#[test]
fn times_since_the_start_are_known_by_their_steps() {
    check_times(&names(|_, t| ((t - START) / 1_000_000).to_string()), START, 1_000_000);
    check_times(&names(|_, t| ((t - START) / 1000).to_string()), START, 1000);
    check_times(&names(|_, t| (t - START).to_string()), START, 1);
    check_times(&names(|k, t| format!("{k:06}-{:012}", (t - START) / 1000)), START, 1000);
    check_times(
        &names(|_, t| format!("{}.{:06}", (t - START) / 1_000_000_000, t % 1_000_000_000 / 1000)),
        START,
        1000,
    );
    check_times(
        &names(|_, t| format!("{:05}_{:09}", (t - START) / 1_000_000_000 + 77, t % 1_000_000_000)),
        START - 77_000_000_000,
        0,
    );
}

#[test]
fn frame_numbers_stay_frame_numbers() {
    for name in [
        |k: i64| format!("{k:06}"),
        |k: i64| format!("{k:06}_cam0"),
        |k: i64| format!("cam2_frame{k}_depth"),
        |k: i64| format!("v1.2_{k}"),
        |k: i64| format!("{k}_{k:04}"),
    ] {
        let numbers = meaning_of(&names(|k, _| name(k))).unwrap();
        assert_eq!(numbers, NameMeaning::Numbers((0..60).collect()), "{}", name(7));
    }
    for step in [5, 20, 100] {
        let numbers = meaning_of(&names(|k, _| (step * k).to_string())).unwrap();
        assert_eq!(numbers, NameMeaning::Numbers((0..60).map(|k| step as u64 * k).collect()));
    }
    assert_eq!(meaning_of(&["depth_0".to_owned()]), Ok(NameMeaning::Numbers(vec![0])));
    let one = [format!("{}.5", START / 1_000_000_000)];
    assert!(matches!(meaning_of(&one), Ok(NameMeaning::Times(times, _)) if times == [START + 500_000_000]));
}

#[test]
fn what_may_be_either_is_refused() {
    let steps = [0, 13, 55, 80, 140, 171, 230];
    let names: Vec<String> = steps.iter().map(ToString::to_string).collect();
    let words = meaning_of(&names).unwrap_err();
    assert!(words.contains("steps of 13 to 60, which may be frames or times; --fps N"), "{words}");
    let stems: Vec<&str> = names.iter().map(String::as_str).collect();
    let at_a_rate = understand(&stems, true).unwrap().meaning;
    assert_eq!(at_a_rate, NameMeaning::Numbers(vec![0, 13, 55, 80, 140, 171, 230]));
    // A date and a time of day, over the end of a minute.
    let names: Vec<String> = (0..90).map(|k| format!("20240131{:02}{:02}", 1000 + k / 60, k % 60)).collect();
    let Ok(NameMeaning::Times(times, _)) = meaning_of(&names) else { panic!("{:?}", meaning_of(&names)) };
    assert_eq!((times[0], times[89]), (1_706_695_200_000_000_000, 1_706_695_289_000_000_000));
    let words = meaning_of(&["1".repeat(25)]).unwrap_err();
    assert!(words.contains("at most 19 digits"), "{words}");
    let many: Vec<String> = (0..9).map(|k| format!("{}_{}_{}", k * 70, 100 - k, k * k * 31)).collect();
    assert!(meaning_of(&many).unwrap_err().contains("3 numbers that change"));
}

#[test]
fn names_of_another_form_are_left_out_with_a_warning_or_refused() {
    let understood = understand(&["1", "2", "3", "preview", "3_small"], false).unwrap();
    assert_eq!(understood.kept, [0, 1, 2]);
    assert!(
        understood
            .warning
            .unwrap()
            .contains("2 images are left out, their names have another form than '1': preview, 3_small")
    );
    let words = understand(&["a1", "b1", "a2", "b2"], false).unwrap_err();
    assert!(words.contains("'a1' and 'b1'"), "{words}");
    assert_eq!(understand(&["x"], false).unwrap().kept.len(), 0);
}
