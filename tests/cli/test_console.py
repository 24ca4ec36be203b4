from lrf3d.cli.console import progress_bar, progress_lines


def test_without_a_terminal_long_work_says_now_and_then_how_far_it_is(capsys):
    time = [0.0]
    report = progress_lines("film", lambda: time[0])
    for done in range(1, 1001):
        time[0] = 0.3 * done
        report(done, 1000)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "lrf3d: film: 102 of 1,000, about 4 min left"
    assert len(lines) == 9


def test_the_first_step_which_may_compile_is_not_one_to_go_by(capsys):
    time = [0.0]
    report = progress_lines("scans", lambda: time[0])
    for done in range(1, 51):
        time[0] = 200.0 + done
        report(done, 50)
    assert capsys.readouterr().err == "lrf3d: scans: 31 of 50, about 1 min left\n"


def test_without_a_terminal_short_work_says_nothing(capsys):
    with progress_bar("scans") as progress:
        for done in range(100):
            progress(done, 100)
    assert capsys.readouterr() == ("", "")
