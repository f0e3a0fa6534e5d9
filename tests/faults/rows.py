"""Every fault that rivid must stand: what must happen, and the tests that make it happen.

A test is named by its file and its function or class. Tests with the fixture `tried` say themselves what they
inject and how often; of the others it stands here, and each of their cases counts once.
"""

# ruff: noqa: E501 (names of tests and words of a table)

from dataclasses import dataclass, field

HERE = "tests/faults/"
READING = f"{HERE}test_reading.py::"
READ = "tests/logs/test_read.py::"
TIMES = "tests/logs/test_times.py::"
EXPORTS = "tests/logs/test_exports.py::"
CORPUS = "tests/test_ingest_corpus.py::"
RUN = "tests/run/test_run.py::"
PROMISES = "tests/run/test_promises.py::"
FLEET = "tests/fleet/"
CHECK = "tests/check/test_"
PROPERTIES = "tests/core/test_properties.py::"


@dataclass(frozen=True)
class Row:
    """A fault.

    Attributes
    ----------
    fault, expected : str
        What may happen; what must then.
    tests : dict of str to str
        What each test injects; empty where the test says it itself.
    """

    fault: str
    expected: str
    tests: dict[str, str] = field(default_factory=dict)


def own(file, *names):
    """Tests of this folder that say themselves what they try."""
    return {f"{HERE}{file}.py::{name}": "" for name in names}


ROWS = (
    Row(
        "Kill -9 at any moment, then the same command again",
        "the tables are those of a run that nothing interrupted, to the byte; nothing that was done is done twice",
        own(
            "test_kills",
            "test_killed_at_every_rename",
            "test_killed_at_random_moments",
            "test_killed_at_many_random_moments",
        )
        | {
            f"{PROMISES}test_tables_left_by_an_interrupted_run_of_other_settings_are_not_taken_for_ours": (
                "stopped between the tables and run.json, with other settings"
            ),
            "tests/test_ingest.py::TestWhatIsThere::"
            "test_killed_between_days_and_started_again_it_ends_as_if_never_killed": "ingest stopped between days",
        },
    ),
    Row(
        "A worker is killed (out of memory)",
        "new workers; the batch is halved until the day that kills is alone, and failed; all others are done",
        own(
            "test_workers",
            "test_workers_killed_at_random_moments_cost_nothing",
            "test_workers_killed_at_many_random_moments_cost_nothing",
        )
        | {
            "tests/run/test_workers.py::test_the_day_that_kills_its_worker_is_alone_and_failed": (
                "a day on which its worker dies, always"
            ),
            f"{FLEET}test_run.py::test_the_day_that_kills_its_worker_is_alone_and_failed": "the same in a fleet",
        },
    ),
    Row(
        "The parent is killed",
        "its workers are gone within 2 s",
        own("test_kills", "test_killed_at_random_moments", "test_killed_at_many_random_moments"),
    ),
    Row(
        "SIGINT, SIGTERM",
        "exit 130 or 143 in less than 2 s, nobody left, what was done is kept",
        own(
            "test_signals",
            "test_signals_in_the_middle_of_a_run",
            "test_a_signal_is_not_lost_while_file_after_file_is_refused",
            "test_many_signals_in_the_middle_of_a_run",
            "test_what_was_done_before_a_signal_is_kept",
        )
        | {
            f"{PROMISES}test_signals_at_any_moment_end_the_run": "four signals, the first at the first import",
        },
    ),
    Row(
        "Two runs into one OUT",
        "the second ends at once with 11; the lock of a killed run does not block",
        own(
            "test_locks",
            "test_a_second_run_is_sent_away_and_a_killed_ones_lock_does_not_block",
            "test_runs_that_start_together_write_one_result",
        )
        | {
            "tests/run/test_shard.py::test_shards_at_the_same_time_lose_nothing": "shards at the same time",
            "tests/run/test_shard.py::test_shards_work_side_by_side_and_keep_a_whole_run_out": (
                "a whole run beside shards"
            ),
            f"{FLEET}test_run.py::test_a_reach_held_by_another_run_is_told_and_the_others_are_run": (
                "one reach of a fleet held, and the whole fleet"
            ),
        },
    ),
    Row(
        "Disk full, file-size limit",
        "one line, nothing partial, no success; with room again the same bytes",
        own(
            "test_disk",
            "test_a_full_disk",
            "test_a_file_size_limit_anywhere",
            "test_a_limit_met_by_the_workers",
            "test_a_full_standard_output",
        )
        | {
            "tests/test_ingest.py::TestWhatIsThere::test_a_full_disk_is_one_line_and_leaves_no_torn_file": (
                "RLIMIT_FSIZE of an ingest"
            ),
        },
    ),
    Row(
        "OUT not writable, DATA_DIR missing or empty",
        "said before anything is computed; 1 or 10",
        own(
            "test_disk",
            "test_out_on_a_read_only_disk_is_told_before_any_work",
            "test_out_that_can_be_no_directory",
        )
        | {
            f"{RUN}test_nothing_to_work_on_is_exit_10": "no DATA_DIR, an empty one",
            f"{PROMISES}test_a_missing_data_dir_makes_no_out": "no DATA_DIR",
            "tests/logs/test_find.py::test_nothing_to_read_says_what_was_looked_for": "no log in DATA_DIR",
        },
    ),
    Row(
        "Truncated Parquet, flipped bits, our own files damaged",
        "an input: the day failed; ours: found by its checksum and made again",
        {
            f"{READING}TestParquet::test_truncated": "cut at 0, 3, 8, half, -1",
            f"{READING}TestParquet::test_flipped_bytes_are_never_taken_as_data": "150 bytes changed, one at a time",
            f"{READING}TestGzip::test_cut_off": "gzip cut in five places",
            f"{READING}TestGzip::test_flipped_bytes": "a byte of a gzip changed",
            f"{PROMISES}test_our_own_files_damaged_are_found_and_written_again": (
                "each file of OUT changed, cut, removed"
            ),
            f"{RUN}test_a_damaged_segment_is_found_and_its_days_are_done_again": "a bit of a segment",
            f"{PROMISES}test_a_broken_note_of_files_is_no_obstacle": "files.json of all kinds",
        },
    ),
    Row(
        "Malformed or half-written CSV",
        "the day failed, file and line named",
        {
            f"{HERE}test_mutations.py::test_any_bytes": "150 mutations each of CSV, gzip, Parquet; a day or many",
            f"{HERE}test_mutations.py::test_any_bytes_declared_unusual": "150 mutations of a French export",
            f"{HERE}test_mutations.py::test_any_bytes_sniffed": "150 mutations, to sniff",
            "tests/test_ingest.py::test_whatever_bytes_an_export_holds_the_account_is_whole_or_there_is_a_reason": (
                "60 mutations each, to ingest"
            ),
            f"{READING}TestCsv::test_a_torn_last_line_fails_the_day": "the last line torn",
            f"{READING}TestCsv::test_a_file_cut_in_the_middle_fails_with_its_gap_or_line": "cut in seven places",
            f"{READING}TestCsv::test_ragged_rows": "a row too short, too long",
            f"{READING}TestCsv::test_what_is_called_a_csv_and_is_none": "gzip, a workbook, Parquet, a PDF as .csv",
            f"{READING}TestCsv::test_a_comment_above_the_header_is_told": "a comment above the header",
        },
    ),
    Row(
        "Wrong, missing or doubled columns",
        "said before any work, with the nearest name",
        {
            "tests/logs/test_find.py::TestColumnsThatNoLogHas": "a column that no log has, or one log lacks",
            f"{READING}TestCsv::test_columns_missing_doubled_and_misspelt": "renamed, doubled, removed",
            f"{READING}TestParquet::test_missing_column": "the same of Parquet",
            f"{READING}TestParquet::test_wrong_types": "lists and numbers for times",
        },
    ),
    Row(
        "NaN, inf, sentinels, status text, unit rows, repeated headers, #N/A",
        "masked and counted, or the day failed; never taken as data",
        own("test_dirt", "test_nothing_is_taken_as_data_that_is_none")
        | {
            f"{READING}TestCsv::test_cells_that_are_no_numbers": "a cell that is no number",
            f"{READING}TestParquet::test_infinite_and_missing_numbers": "NaN and inf in Parquet",
            "tests/logs/test_sentinels.py::": "sentinels of all kinds, and what is none",
            f"{EXPORTS}test_a_repeated_header_is_refused_or_dropped": "a header again",
            CORPUS: "the exports of tests/data/exports",
        },
    ),
    Row(
        "Decimal comma, semicolon, BOM, latin-1, UTF-16, dd/mm/yyyy, 24:00, thousands",
        "read when declared, refused with a hint when not; `sniff` proposes",
        {
            f"{EXPORTS}test_a_declared_export_is_read": "exports as declared",
            f"{EXPORTS}test_an_undeclared_export_is_refused_with_what_to_declare": "exports without declaration",
            f"{EXPORTS}test_each_declaration_left_out_is_asked_for": "each declaration left out",
            f"{EXPORTS}test_what_sniff_proposes_reads_the_file_it_came_from": "what sniff proposes",
            "tests/test_sniff_corpus.py::": "sniff on the corpus",
            "tests/test_ingest_roundtrip.py::": "days written in 19 dialects, and back",
        },
    ),
    Row(
        "Duplicate, missing, irregular, backward times; clocks that drift",
        "put on the grid and counted, or the day failed",
        own("test_dirt", "test_nothing_is_taken_as_data_that_is_none")
        | {
            f"{READ}test_duplicates_that_agree_are_dropped_and_counted": "rows doubled",
            f"{READ}test_duplicates_that_conflict_fail_the_day": "two values at a time",
            f"{READ}test_rows_out_of_order_are_sorted_and_counted": "rows swapped",
            f"{READ}test_a_short_gap_is_filled_and_counted": "a short gap",
            f"{READ}test_a_long_gap_fails_the_day_and_says_where": "a long gap",
            f"{READ}test_too_many_short_gaps_fail_the_day": "many short gaps",
            f"{READ}test_clocks_rounded_to_milliseconds_decide_no_sample": "clocks rounded",
            "tests/logs/test_grid.py::": "random gaps and unsteady clocks against a slow grid",
        },
    ),
    Row(
        "Days of 23 and 25 h; times that do not exist or come twice",
        "a zone or offset is required; what is ambiguous is an error unless configured",
        {
            TIMES: "both nights of Paris, a year of hours, zones",
            "tests/logs/test_midnight.py::": "rows at midnight",
        },
    ),
    Row(
        "Constant or nearly constant input",
        "`unidentifiable`, by every estimator",
        own("test_dirt", "test_what_does_not_move_is_identified_by_no_estimator")
        | {
            f"{RUN}test_a_constant_inflow_is_unidentifiable": "an inflow constant, and but for 1e-9",
            "tests/core/test_jmap.py::test_motionless_days_are_unidentifiable_and_leave_the_others_alone": (
                "days without motion among others"
            ),
            "tests/core/test_properties.py::test_any_finite_input_gives_a_result_or_a_reason": (
                "25 to 60 generated series, for each estimator"
            ),
        },
    ),
    Row(
        "Wrong units",
        "`check` names the unit, by range, water balance and the pool's area, with factor and dates",
        {
            f"{CHECK}units.py::test_a_column_in_another_unit": (
                "cfs, L/s, m3/h, cm, mm or ft, or converted twice, on 1, 7 or 40 days"
            ),
            f"{CHECK}units.py::test_the_unit_of_the_level_in_other_reaches": "a level in cm or ft, three reaches",
            f"{CHECK}units.py::test_a_unit_that_changes_on_a_date": "a unit that changes on a date",
            f"{CHECK}units.py::test_both_flows_in_another_unit_are_found_by_their_range_or_by_the_level": (
                "both flows in cfs"
            ),
            f"{CHECK}units.py::test_a_declared_unit_that_does_not_fit": "a unit that is declared and is not so",
            f"{CHECK}units.py::test_a_missing_part_of_the_outflow_is_found_over_weeks_and_not_on_a_single_day": (
                "half of the outflow lost for ten days"
            ),
        },
    ),
    Row(
        "Clocks an hour or a day off, clocks that drift, summer time in a logger, columns swapped",
        "`check` names the column, how much, and the dates",
        {
            f"{CHECK}clocks.py::test_a_clock_that_is_an_hour_off_from_a_date_on": "one column an hour early or late, from a date on",
            f"{CHECK}clocks.py::test_a_clock_that_is_an_hour_off_on_every_day_gives_impossible_lags": "the same on every day",
            f"{CHECK}clocks.py::test_a_clock_that_drifts": "one column's clock 60 to 90 s a day fast or slow",
            f"{CHECK}clocks.py::test_dates_that_are_a_day_off": "one column dated a day early or late",
            f"{CHECK}clocks.py::test_exchanged_columns_from_a_date_on_or_always": "inflow and outflow swapped",
            f"{CHECK}clocks.py::test_a_level_that_is_measured_downwards": "a level measured downwards",
            f"{CHECK}clocks.py::test_a_river_with_exchanged_ends": "a river's ends swapped",
            f"{CHECK}clocks.py::test_a_river_clock_that_is_an_hour_off_from_a_date_on": "an hour in a river",
            f"{CHECK}spacing.py::test_a_logger_that_keeps_summer_time_is_found_by_both_nights": (
                "a logger that keeps summer time"
            ),
            f"{CHECK}spacing.py::": "rows more or less often than sample_time",
        },
    ),
    Row(
        "A gauge that stands still or jumps, copies of days, flows that never move",
        "`check` names the times of day and the dates, once",
        {
            f"{CHECK}gauge.py::test_a_gauge_that_stands_still_for_hours": "a gauge stuck for five hours",
            f"{CHECK}gauge.py::test_a_gauge_that_stands_still_for_days_is_one_finding": "a gauge stuck for a week",
            f"{CHECK}gauge.py::test_a_dead_gauge_on_every_day": "a gauge dead on every day",
            f"{CHECK}gauge.py::test_a_jump_that_stays": "a gauge that jumps by 0.2 to 3 m, at midnight too",
            f"{CHECK}gauge.py::test_a_spike": "three readings of another world",
            f"{CHECK}gauge.py::test_a_copied_day_and_a_copied_week": "a day under two dates, a week copied",
            f"{CHECK}gauge.py::test_the_level_of_another_day": "the level of another day",
            f"{CHECK}gauge.py::test_a_command_with_a_lost_digit_is_a_remark": "a command a thousandth of itself",
            f"{CHECK}gauge.py::test_constant_flows": "an outflow that never moves",
        },
    ),
    Row(
        "Sound logs, of any kind of reach",
        "`check` says nothing",
        {
            f"{CHECK}false_alarms.py::{name}": ""
            for name in (
                "test_sound_seasons_give_no_finding",
                "test_sound_seasons_without_a_logged_outflow_give_no_finding",
                "test_long_sound_seasons_give_few_findings",
                "test_the_sample_data_give_no_finding",
            )
        }
        | {
            f"{CHECK}gauge.py::test_a_coarse_gauge_is_not_stuck": "a gauge of steps of 2, 5 and 10 cm",
            f"{CHECK}units.py::test_a_reservoir_that_fills_closes_its_balance": "a reservoir that fills",
        },
    ),
    Row(
        "Any finite input",
        "a result or a reason, and what symmetry demands",
        own("test_check_anything", "test_any_finite_days_give_finite_findings", "test_any_bytes_checked")
        | {
            f"{PROPERTIES}test_any_finite_input_gives_a_result_or_a_reason": (
                "25 to 60 generated series from 1e-30 to 1e36, for each estimator"
            ),
            f"{PROPERTIES}test_scaling_y_scales_h_and_leaves_d": "60 seasons scaled by 1e-12 to 1e12, either sign",
            f"{PROPERTIES}test_adding_a_constant_changes_nothing": "60 seasons, with constants added",
            f"{PROPERTIES}test_shifting_the_inflow_by_a_sample_shifts_d_by_one": (
                "60 noise-free days, the inflow a sample earlier or later"
            ),
            f"{PROPERTIES}test_noise_free_the_delay_is_found": "60 noise-free days",
            f"{PROPERTIES}test_a_number_that_is_none_is_refused_with_its_row": "40 days with a NaN or an infinity",
        },
    ),
    Row(
        "Fewer samples than M, all days failing, one day only",
        "a clear status, exit 3, figures still drawn",
        own("test_dirt", "test_days_without_any_sound_one_still_have_figures")
        | {
            f"{RUN}test_too_few_samples_for_the_fir_fail_the_day": "24 samples",
            f"{RUN}test_all_days_failing_still_give_tables_and_a_report": "all days failing",
            f"{RUN}test_one_day_alone": "one day",
            "tests/run/test_estimators.py::test_a_day_too_short_for_the_longest_delay_fails_and_names_the_key": (
                "a day too short, for each estimator"
            ),
        },
    ),
    Row(
        "Names: `../x`, `CON`, link loops, links that lead out",
        "names are [A-Za-z0-9._-]; a path stays inside its root",
        own(
            "test_texts",
            "test_a_name_that_leads_elsewhere_is_refused",
            "test_hostile_names_of_reaches_of_a_fleet",
            "test_names_of_devices_and_options_for_reaches_logs_and_directories",
            "test_an_out_that_parquet_cannot_name_is_one_line",
            "test_out_with_links_that_lead_out_writes_nothing_through_them",
        )
        | {
            f"{HERE}test_texts.py::test_a_reach_is_called_by_letters_digits_dot_underscore_hyphen": (
                "300 generated names"
            ),
            f"{READING}TestNamesAndLinks": "links out, loops, pipes, names that are no dates or no UTF-8",
            f"{FLEET}test_layout.py::test_an_odd_name_costs_only_its_reach": "odd names in a fleet",
            f"{FLEET}test_layout.py::test_a_link_that_leads_out_is_refused_and_one_that_stays_is_not": (
                "a reach that is a link out"
            ),
            "tests/test_ingest.py::TestWhatIsThere::test_a_link_is_not_followed": "a log to write that is a link",
        },
    ),
    Row(
        "A spreadsheet's formula in a cell, `<script>` in a name",
        "an apostrophe in front; shown as text",
        own("test_texts", "test_hostile_cells_end_as_text", "test_hostile_file_names_end_as_text")
        | {
            "tests/report/test_page.py::test_names_and_reasons_are_text_and_never_markup": "markup in every text of a report",
            f"{FLEET}test_run.py::test_the_page_shows_hostile_text_as_text": "markup in a fleet's page",
        },
    ),
    Row(
        "Bombs: Parquet, gzip, sparse files",
        "refused by rows and bytes, before they are read",
        own("test_bombs", "test_bombs_are_refused_by_every_command_that_reads")
        | {
            f"{READING}TestParquet::test_a_bomb_is_refused_by_its_rows": "20 million rows, refused within 1 s",
            f"{READING}TestParquet::test_a_long_text_that_many_rows_share_is_not_multiplied": "a text of 1 MB, shared",
            f"{READING}TestGzip::test_a_bomb_is_refused_while_it_unpacks": "gzip of 105 MB",
            f"{READING}test_a_huge_sparse_file_is_not_read": "a sparse file of 50 GB, refused within 1 s",
        },
    ),
    Row(
        "Hostile configuration: deep TOML, 10^9 workers, NaN, unknown keys",
        "one line, exit 2",
        own(
            "test_config_attacks",
            "test_any_keys_with_any_values",
            "test_deep_and_long",
            "test_the_command_says_one_line_and_writes_nothing",
            "test_what_is_no_file",
            "test_hostile_options",
        )
        | own("test_check_anything", "test_a_hostile_configuration_of_a_check_is_one_line")
        | {
            "tests/test_config.py::test_a_fault_names_the_key_what_came_and_what_is_valid": "a fault of each kind",
            f"{READING}test_hostile_declarations_are_refused_in_one_line": "hostile [input]",
        },
    ),
    Row(
        "Pickles",
        "never read",
        {f"{READING}test_pickles_are_never_opened": "pickles as .pkl, .npy, .csv and .parquet"},
    ),
    Row(
        "An upgrade; results of another version",
        "old results are read and taken up; newer ones are told and left alone",
        own(
            "test_old_results",
            "test_old_results_are_read_drawn_and_taken_up",
            "test_newer_results_are_told_and_left_alone",
            "test_a_damaged_record_is_one_line_for_readers_and_no_obstacle_for_a_run",
            "test_a_table_without_a_column_is_one_line",
            "test_segments_with_other_columns_are_dropped_and_their_days_done_again",
        )
        | {f"{PROMISES}test_results_of_a_newer_rivid_are_left_alone": "schema 99"},
    ),
)
