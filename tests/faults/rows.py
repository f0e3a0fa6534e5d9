"""The faults that rivid must withstand, each with the expected result and the tests that inject it.

Notes of the fixture `tried` state what a test injects and how often; other tests are listed by their names.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """A fault, the expected result, and its tests (`file::name`, or `file::` for all tests of a file)."""

    fault: str
    expected: str
    tests: list[str]


TEXT = """
Kill -9 at any moment, then the same command again
  -> the tables are those of a run that nothing interrupted, to the byte; nothing that was done is done twice
  faults/test_kills: test_killed_at_every_rename test_killed_at_random_moments
  run/test_promises: test_tables_of_an_interrupted_run_with_other_settings_are_written_again
  test_ingest: TestWhatIsThere::test_killed_between_days_and_started_again_it_ends_as_if_never_killed
A worker is killed (out of memory)
  -> new workers; the batch is halved until the day that kills is alone, and failed; all others are done
  faults/test_workers: test_workers_killed_at_random_moments_cost_nothing
  run/test_workers: test_the_day_that_kills_its_worker_is_alone_and_failed
  fleet/test_run: test_the_day_that_kills_its_worker_is_alone_and_failed
The parent is killed
  -> its workers are gone within 2 s
  faults/test_kills: test_killed_at_random_moments
SIGINT, SIGTERM
  -> exit 130 or 143 in less than 2 s, no process remains, finished work is kept
  faults/test_signals: test_signals_in_the_middle_of_a_run
      test_a_signal_is_not_lost_while_file_after_file_is_refused test_what_was_done_before_a_signal_is_kept
Two runs into one OUT
  -> the second ends at once with 11; the lock of a killed run does not block
  faults/test_locks: test_a_second_run_is_refused_and_the_lock_of_a_killed_run_does_not_block
      test_runs_that_start_together_write_one_result
  run/test_shard: test_shards_at_the_same_time_lose_nothing
      test_shards_hold_out_together_and_keep_a_whole_run_out
  fleet/test_run: test_a_reach_held_by_another_run_has_code_11_and_the_others_are_run
Disk full, file-size limit
  -> one line, nothing partial, no success; with room again the same bytes
  faults/test_disk: test_a_full_disk test_a_file_size_limit_anywhere test_a_limit_met_by_the_workers
      test_a_worker_that_writes_while_another_fails_leaves_nothing_partial
      test_a_full_standard_output
  test_ingest: TestWhatIsThere::test_a_full_disk_is_one_line_and_leaves_no_torn_file
OUT not writable, DATA_DIR missing or empty
  -> reported before anything is computed; 1 or 10
  faults/test_disk: test_out_on_a_read_only_disk_is_refused_before_any_work
      test_out_that_can_be_no_directory
  run/test_run: test_nothing_to_work_on_is_exit_10
  run/test_promises: test_places_and_days_that_cannot_be_run
  logs/test_find: test_nothing_to_read_reports_what_was_looked_for
Truncated Parquet, flipped bits, our own files damaged
  -> an input: the day failed; ours: found by its checksum and made again
  faults/test_reading: TestParquet::test_truncated TestParquet::test_flipped_bytes_are_never_taken_as_data
      TestGzip::test_cut_off TestGzip::test_flipped_bytes_and_no_gzip_at_all
  run/test_promises: test_damaged_files_of_out_are_found_and_written_again
      test_a_broken_note_of_files_is_no_obstacle
  run/test_run: test_a_damaged_segment_is_found_and_its_days_are_done_again
Malformed or half-written CSV
  -> the day failed, file and line named
  faults/test_mutations: test_any_bytes test_any_bytes_sniffed
  test_ingest: test_whatever_bytes_an_export_holds_the_account_is_whole_or_there_is_a_reason
  faults/test_reading: TestCsv::test_a_torn_last_line_fails_the_day
      TestCsv::test_a_file_cut_in_the_middle_fails_with_its_gap_or_line TestCsv::test_ragged_rows
      TestCsv::test_what_is_called_a_csv_and_is_none TestCsv::test_a_comment_above_the_header_is_reported
Wrong, missing or doubled columns
  -> reported before any work, with the nearest name
  logs/test_find: TestColumnsThatNoLogHas
  faults/test_reading: TestCsv::test_columns_missing_doubled_and_misspelt TestParquet::test_wrong_columns
NaN, inf, sentinels, status text, unit rows, repeated headers, #N/A
  -> masked and counted, or the day failed; never taken as data
  faults/test_dirt: test_nothing_is_taken_as_data_that_is_none
  faults/test_reading: TestCsv::test_cells_that_are_no_numbers
      TestParquet::test_infinite_and_missing_numbers
  logs/test_sentinels: *
  logs/test_exports: test_a_repeated_header_is_refused_or_dropped
  test_ingest_corpus: *
Decimal comma, semicolon, BOM, latin-1, UTF-16, dd/mm/yyyy, 24:00, thousands
  -> read when declared, refused with a hint when not; `sniff` proposes
  logs/test_exports: test_a_declared_export_is_read
      test_an_undeclared_export_is_refused_with_what_to_declare test_each_declaration_left_out_is_asked_for
      test_what_sniff_proposes_reads_the_file_it_came_from
  test_sniff_corpus: *
  test_ingest_roundtrip: *
Duplicate, missing, irregular, backward times; clocks that drift
  -> put on the grid and counted, or the day failed
  faults/test_dirt: test_nothing_is_taken_as_data_that_is_none
  logs/test_read: test_rows_that_change_no_value_are_sorted_or_dropped_and_counted
      test_duplicates_that_conflict_fail_the_day
      test_a_short_gap_is_filled_and_counted test_a_long_gap_fails_the_day_and_reports_where
      test_too_many_short_gaps_fail_the_day test_clocks_rounded_to_milliseconds_decide_no_sample
  logs/test_grid: *
Days of 23 and 25 h; times that do not exist or come twice
  -> a zone or offset is required; what is ambiguous is an error unless configured
  logs/test_times: *
  logs/test_midnight: *
Constant or nearly constant input
  -> `unidentifiable`, by every estimator
  faults/test_dirt: test_what_does_not_move_is_identified_by_no_estimator
  run/test_run: test_a_constant_inflow_is_unidentifiable
  core/test_jmap: test_motionless_days_are_unidentifiable_and_leave_the_others_alone
  core/test_properties: test_any_finite_input_gives_a_result_or_a_reason
Wrong units
  -> `check` names the unit, by range, water balance and the pool's area, with factor and dates
  check/test_units: test_a_column_in_another_unit test_a_unit_that_changes_on_a_date
      test_both_flows_in_another_unit_are_found_by_their_range_or_by_the_level
      test_a_declared_unit_that_does_not_fit
      test_a_missing_part_of_the_outflow_is_found_over_weeks_and_not_on_a_single_day
Clocks an hour or a day off, clocks that drift, summer time in a logger, columns swapped
  -> `check` names the column, how much, and the dates
  check/test_clocks: test_a_clock_that_is_an_hour_off_from_a_date_on
      test_a_clock_that_is_an_hour_off_on_every_day_gives_impossible_lags test_a_clock_that_drifts
      test_dates_that_are_a_day_off test_exchanged_or_inverted_columns_from_a_date_on_or_always
      test_a_river_with_exchanged_ends_or_a_clock_that_is_an_hour_off_from_a_date_on
  check/test_spacing: *
A gauge that stands still or jumps, copies of days, flows that never move
  -> `check` names the times of day and the dates, once
  check/test_gauge: test_a_gauge_that_stands_still_for_hours_or_days test_a_dead_gauge_on_every_day
      test_a_jump_that_stays test_a_spike test_copies_of_a_day_of_a_week_and_of_a_level
      test_a_command_with_a_lost_digit_is_a_remark test_constant_flows
Sound logs, of any kind of reach
  -> `check` reports nothing
  check/test_false_alarms: test_sound_seasons_give_no_finding
      test_sound_seasons_with_and_without_a_logged_outflow_give_no_finding
      test_long_sound_seasons_give_few_findings test_the_sample_data_give_no_finding
  check/test_gauge: test_a_coarse_gauge_is_not_stuck
  check/test_units: test_a_reservoir_that_fills_closes_its_balance
Any finite input
  -> a result or a reason, and what symmetry demands
  faults/test_check_anything: test_any_finite_days_give_finite_findings test_any_bytes_checked
  core/test_properties: test_any_finite_input_gives_a_result_or_a_reason
      test_scaling_y_scales_h_and_leaves_d test_adding_a_constant_changes_nothing
      test_shifting_the_inflow_by_a_sample_shifts_d_by_one test_noise_free_the_delay_is_found
      test_a_number_that_is_none_is_refused_with_its_row
Fewer samples than M, all days failing, one day only
  -> a clear status, exit 3, figures still drawn
  faults/test_dirt: test_days_without_any_sound_one_still_have_figures
  run/test_run: test_too_few_samples_for_the_fir_fail_the_day
      test_all_days_failing_still_give_tables_and_a_report
  run/test_estimators: test_a_day_too_short_for_the_longest_delay_fails_and_names_the_key
Names: `../x`, `CON`, link loops, links that lead out
  -> names are [A-Za-z0-9._-]; a path stays inside its root
  faults/test_texts: test_a_name_that_leads_elsewhere_is_refused test_hostile_names_of_reaches_of_a_fleet
      test_names_of_devices_and_options_for_reaches_logs_and_directories
      test_an_out_that_parquet_cannot_name_is_one_line
      test_out_with_links_that_lead_out_writes_nothing_through_them
      test_a_reach_is_called_by_letters_digits_dot_underscore_hyphen
  faults/test_reading: TestNamesAndLinks
  fleet/test_layout: test_an_invalid_name_fails_only_its_reach
      test_a_link_that_leads_out_is_refused_and_one_that_stays_is_not
  test_ingest: TestWhatIsThere::test_a_link_is_not_followed
A spreadsheet's formula in a cell, `<script>` in a name
  -> an apostrophe in front; shown as text
  faults/test_texts: test_hostile_cells_and_file_names_end_as_text
      test_a_hostile_header_is_escaped_in_one_line
  report/test_page: test_names_and_reasons_are_text_and_never_markup
  fleet/test_run: test_the_page_shows_hostile_text_as_text
Bombs: Parquet, gzip, sparse files
  -> refused by rows and bytes, before they are read
  faults/test_bombs: test_bombs_are_refused_by_every_command_that_reads
  faults/test_reading: TestParquet::test_a_bomb_is_refused_by_its_rows
      TestParquet::test_a_long_text_that_many_rows_share_is_not_multiplied
      TestGzip::test_a_bomb_is_refused_while_it_unpacks test_a_huge_sparse_file_is_not_read
Hostile configuration: deep TOML, 10^9 workers, NaN, unknown keys
  -> one line, exit 2
  faults/test_config_attacks: test_any_keys_with_any_values test_deep_and_long
      test_the_command_prints_one_line_and_writes_nothing test_hostile_options
  faults/test_check_anything: test_a_hostile_configuration_of_a_check_is_one_line
  test_config: test_a_fault_names_the_key_what_came_and_what_is_valid
  faults/test_reading: test_hostile_declarations_are_refused_in_one_line
Pickles
  -> never read
  faults/test_reading: test_pickles_are_never_opened
An upgrade; results of another version
  -> old results are read and taken up; newer ones are refused and left unchanged
  faults/test_old_results: test_old_results_are_read_drawn_and_taken_up
      test_newer_results_are_refused_and_left_alone
      test_damaged_results_are_refused_by_readers_and_replaced_by_a_run
      test_segments_with_other_columns_are_dropped_and_their_days_done_again
"""
"""Without indentation: a fault. "->": the expected result. "file:": its tests in a file; "*": all tests."""


def read_rows(text: str) -> list[Row]:
    """Return the rows of :data:`TEXT`."""
    rows: list[Row] = []
    for line in filter(None, text.splitlines()):
        if not line.startswith(" "):
            fault = line
        elif line.startswith("  -> "):
            rows.append(Row(fault, line[5:], []))
        else:
            for word in line.split():
                if word.endswith(":"):
                    file = f"tests/{word[:-1]}.py::"
                else:
                    rows[-1].tests.append(file + word.removeprefix("*"))
    return rows


ROWS = read_rows(TEXT)
