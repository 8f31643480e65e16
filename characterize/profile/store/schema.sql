-- The profile database of pirt, version 7. One SQLite file, journal mode DELETE: closed, it is one file and opens read-only.
--
-- Other tools read the views profile_summary, energy_summary, condition_summary, handover_summary and unit_time_summary: their columns, in
-- this order, are stable; new ones come at their end. profile_summary has one row a phase and set-up state, so that who asks it for phase
-- 'execute' gets the figure of calls in a row; what else a call may take is in condition_summary, what handing it to its unit takes in
-- handover_summary, and what is known of units beside their calls, that included, in unit_time_summary.
-- The tables are pirt's own. Readers refuse every other user_version. All times are integer nanoseconds, started/finished are UTC (ISO 8601).
--
-- Words in `reasons` (why a row is no figure of its workload on its unit: it is shown, and never used), `doubts` (why its interval is wide:
-- it is used, and marked) and `notes` (what to know about it) are separated by "; ", and "" means none. `valid` = 1: neither reasons nor doubts.
--   doubts:  few_samples       fewer samples than asked for, or from fewer than 3 processes; fewer set-ups than asked for
--            few_samples: TEXT of a unit beside its calls: taking the others failed
--            throttled         the processor or the container was throttled while a quarter of the processes or more were timed
--            unstable          first and second half of the samples or of the processes differ, also after one re-measurement
--            imprecise         half the interval is more than 20 % of the median; of a call's phases, and more than 5 % of the call; of
--                              set-ups, and more than 1 ms (of two, the interval is what they span)
--            contended         others used more than 5 % of the unit's cores beside a quarter of the processes, also after one
--                              re-measurement, and the cell's precision was not reached, or they used 25 %; of set-ups, they used 25 %;
--                              of a meter's joules, they used more than 5 % of the machine's cores
--            odd_stamps        more than 1 % of the device's stamps say that launching took longer than the execution that it is part of
--            unstable: TEXT    energy only: idling before and after, or calls metered and timed, differ
--   reasons: wrong_output      the output did not match the reference, before or after timing
--            no_samples        the row has none
--            clock_bound       the clock's cost or step is more than 1 % of what was timed in one go
--            no_power          energy only: the platform gives no watts for the unit, or none of the device that it has
--            ops_unknown       energy only: op_pj is given but the workload's operations depend on the data
--            meter_frozen      energy only: the meter reads 0, or the same all the time, under load too
--            meter_error: TEXT energy only: the meter could not be read
--            not_measurable: TEXT  energy only: a step of the meter is more than 5 % of what the calls drew above idle, also after 20 s
--            not_above_idle: TEXT  energy only: the calls drew no more than idling did
--            error: TEXT       the worker failed; the row has then what was sampled before, or no samples
--            counts_differ: TEXT  the device says that its figures repeat exactly, and they did not
--            unknown: TEXT     nobody knows the phase's time, and why; the row has no samples
--            unavailable: TEXT peak only: the device has no loop for it, and why
--            exceeded by TEXT  peak only: that workload ran faster, so the peak was measured too low
--   notes:   input_resized, input_cropped, precision_not_reached (see ci_low_ns, ci_high_ns), contended (and precise all the same),
--            bimodal (two groups of samples, or of processes), no_kernel_cache,
--            shared_core, pinned_outputs (downloaded to memory that the device
--            writes at once), sequence of N frames (played; ops and bytes are the mean over them),
--            failed_processes: N (of the cell; one that fails is tried once more, and two end it),
--            odd_stamps (of up to 1 % of the executions, which are left out),
--            unverified (it has no reference: held against the first unit's outputs, and its own), program: TEXT (what a call to it takes),
--            slices: TEXT (its calls have others than its module says, which schedules believe),
--            deterministic (the figure repeats exactly: one sample is all there is, its interval has no width)
--            live (calls of a live run, `pirt schedule --update-profile`: one process, other calls between them)
-- Statistics are NULL where there are no samples. median_ns is the median of the processes' medians; ci_low_ns and ci_high_ns its 95 %
-- interval over processes (characterize/statistics/statistics.h). Of fewer than 3 processes (`few_samples`): what these span, or the interval
-- of a single one's samples, a factor of 1.5 wider either way.
-- cpu_ns is the processor time of a call on the host's cores, where that was told beside its time, median as that; `taken` the share of the
-- time of a row with `contended` that others had its cores: its interval reaches down to what the call would have taken without them.
-- `checksum` columns are FNV-1a over what a run (with its environment, units, peaks, times, and which cells and visits it has) or a cell
-- (with its measurements, samples and energy) holds (database_format.h): damage that SQLite cannot see is an error.

PRAGMA application_id = 1346982484;  -- "PIRT"
PRAGMA user_version = 7;

-- One `pirt characterize`. `finished` is NULL if it did not end; its cells are complete all the same.
CREATE TABLE run (
  run_id   INTEGER PRIMARY KEY,
  started  TEXT NOT NULL CHECK (started <> ''),
  finished TEXT CHECK (finished <> ''),
  platform TEXT NOT NULL CHECK (platform <> ''),
  seed     TEXT NOT NULL CHECK (seed <> ''),  -- decimal: 64 bits unsigned do not fit SQLite's integers
  plan     TEXT CHECK (plan <> ''),           -- JSON: options and cells planned, what --resume continues; NULL if it cannot be resumed
  checksum INTEGER NOT NULL
) STRICT;

-- What is known of the machine and the build. What is not known has no key, but a key `<key>_unknown` that says why.
CREATE TABLE environment (
  run_id INTEGER NOT NULL REFERENCES run,
  key    TEXT NOT NULL CHECK (key <> ''),
  value  TEXT NOT NULL CHECK (value <> ''),
  kind   TEXT NOT NULL CHECK (kind IN ('identity', 'information')),  -- identity: must match for two runs to be comparable
  PRIMARY KEY (run_id, key)
) STRICT, WITHOUT ROWID;

-- The units that were measured, and the device that each computed on.
CREATE TABLE unit (
  run_id        INTEGER NOT NULL REFERENCES run,
  unit          TEXT NOT NULL CHECK (unit <> ''),
  ordinal       INTEGER NOT NULL,               -- order in the platform file
  backend       TEXT NOT NULL CHECK (backend <> ''),
  device        TEXT NOT NULL CHECK (device <> ''),
  device_is_cpu INTEGER NOT NULL CHECK (device_is_cpu IN (0, 1)),
  cores         TEXT NOT NULL,                  -- "0,1": the host cores that it owned; "" = all
  PRIMARY KEY (run_id, unit)
) STRICT, WITHOUT ROWID;

-- Worker processes of cells that need more of them: what `pirt characterize --resume` goes on from. A cell's are gone when it is done;
-- a cell that stands in `cell` beside its visits was written when the run was interrupted, with what there was.
CREATE TABLE visit (
  run_id   INTEGER NOT NULL REFERENCES run,
  workload TEXT NOT NULL CHECK (workload <> ''),
  unit     TEXT NOT NULL CHECK (unit <> ''),
  position INTEGER NOT NULL CHECK (position >= 0),  -- order in time within the cell
  setup    TEXT NOT NULL CHECK (setup IN ('cold', 'warm')),
  record   TEXT NOT NULL,                           -- what the worker reported (characterize/job.h)
  checksum INTEGER NOT NULL,                        -- FNV-1a over all other columns
  PRIMARY KEY (run_id, workload, unit, position)
) STRICT, WITHOUT ROWID;

-- What each unit can do at most: one row per (run, unit, kind), the roofline that workloads are held against.
CREATE TABLE peak (
  run_id     INTEGER NOT NULL,
  unit       TEXT NOT NULL,
  kind       TEXT NOT NULL CHECK (kind IN ('f32', 'int8', 'bandwidth_l2', 'bandwidth_memory')),
  per_second REAL CHECK (per_second > 0),       -- operations (f32, int8) or bytes (bandwidth_*) a second; NULL if unknown
  variant    TEXT NOT NULL,                     -- which loop was the fastest; "" if none ran
  provenance TEXT NOT NULL CHECK (provenance IN ('measured', 'counted', 'modelled', 'fitted', 'published')),
  valid      INTEGER NOT NULL CHECK (valid IN (0, 1)),
  reasons    TEXT NOT NULL,
  doubts     TEXT NOT NULL,
  PRIMARY KEY (run_id, unit, kind),
  FOREIGN KEY (run_id, unit) REFERENCES unit,
  CHECK ((valid = 1) = (reasons = '' AND doubts = '')),
  CHECK (per_second IS NOT NULL OR reasons <> '')
) STRICT, WITHOUT ROWID;

-- What units that are threads of the host take beside their calls, no part of `call`; of one process.
--   handover     with the runtime's own queue, from handing a call to the unit until it begins, after the unit has slept for that long (0:
--                the call waits while another one runs, and the time is that between them)
--   leave        with the runtime, from the end of a slice at which a call is left until it goes on, with nothing of what was let in
--   reread       reading an eighth of what the last cache holds, for that long after it was read before, the unit asleep meanwhile
--   reread_cold  the same after as many other bytes as the last cache holds
CREATE TABLE unit_time (
  unit_time_id INTEGER PRIMARY KEY,
  run_id     INTEGER NOT NULL,
  unit       TEXT NOT NULL,
  phase      TEXT NOT NULL CHECK (phase IN ('handover', 'leave', 'reread', 'reread_cold')),
  sleep_ns   INTEGER NOT NULL CHECK (sleep_ns >= 0),
  valid      INTEGER NOT NULL CHECK (valid IN (0, 1)),
  reasons    TEXT NOT NULL,
  samples    INTEGER NOT NULL CHECK (samples >= 0),
  median_ns  INTEGER CHECK (median_ns >= 0),
  mad_ns     INTEGER CHECK (mad_ns >= 0),
  p95_ns     INTEGER CHECK (p95_ns >= 0),
  p99_ns     INTEGER CHECK (p99_ns >= p95_ns),
  ci_low_ns  INTEGER CHECK (ci_low_ns <= median_ns),
  ci_high_ns INTEGER CHECK (ci_high_ns >= median_ns),
  doubts     TEXT NOT NULL,
  UNIQUE (run_id, unit, phase, sleep_ns),
  FOREIGN KEY (run_id, unit) REFERENCES unit,
  CHECK (sleep_ns = 0 OR phase IN ('handover', 'reread')),
  CHECK ((valid = 1) = (reasons = '' AND doubts = '')),
  CHECK (samples > 0 OR reasons <> ''),
  CHECK ((samples = 0) = (median_ns IS NULL) AND (median_ns IS NULL) = (mad_ns IS NULL)),
  CHECK ((median_ns IS NULL) = (p95_ns IS NULL) AND (median_ns IS NULL) = (p99_ns IS NULL)),
  CHECK ((ci_low_ns IS NULL) = (ci_high_ns IS NULL) AND (samples > 0 OR ci_low_ns IS NULL))
) STRICT;

-- In the order in which they were taken.
CREATE TABLE unit_time_sample (
  unit_time_id INTEGER NOT NULL REFERENCES unit_time,
  position     INTEGER NOT NULL CHECK (position >= 0),
  ns           INTEGER NOT NULL CHECK (ns >= 0),
  PRIMARY KEY (unit_time_id, position)
) STRICT, WITHOUT ROWID;

-- One workload on one unit; written in one transaction with everything below it.
CREATE TABLE cell (
  cell_id      INTEGER PRIMARY KEY,
  run_id       INTEGER NOT NULL,
  workload     TEXT NOT NULL CHECK (workload <> ''),
  unit         TEXT NOT NULL,
  ops          INTEGER CHECK (ops >= 0),        -- operations a call; NULL where they depend on the data
  bytes        INTEGER NOT NULL CHECK (bytes >= 0),
  verification TEXT NOT NULL,                   -- what the comparison with the reference found; "" if none took place
  checksum     INTEGER NOT NULL,
  host_memory_bytes   INTEGER CHECK (host_memory_bytes >= 0),    -- what its process has for it there, and the device; NULL if unknown
  device_memory_bytes INTEGER CHECK (device_memory_bytes >= 0),
  UNIQUE (run_id, workload, unit),
  FOREIGN KEY (run_id, unit) REFERENCES unit
) STRICT;

CREATE TABLE measurement (
  measurement_id INTEGER PRIMARY KEY,
  cell_id    INTEGER NOT NULL REFERENCES cell,
  phase      TEXT NOT NULL CHECK (phase IN ('device_init', 'prepare', 'upload', 'launch', 'execute', 'download', 'call')),
  -- cold, warm: of a set-up, which met an empty kernel cache or a filled one. The others are of calls: in a row, or after the unit's own
  -- caches, or the last ones with all before it, were filled with other bytes, or while another unit of the same memory streams through it,
  -- or computes.
  state      TEXT NOT NULL CHECK (state IN ('cold', 'warm', 'steady', 'cold_cache', 'cold_memory', 'beside_memory', 'beside_compute')),
  provenance TEXT NOT NULL CHECK (provenance IN ('measured', 'counted', 'modelled', 'fitted', 'published')),
  valid      INTEGER NOT NULL CHECK (valid IN (0, 1)),
  reasons    TEXT NOT NULL,
  notes      TEXT NOT NULL,
  samples    INTEGER NOT NULL CHECK (samples >= 0),
  processes  INTEGER NOT NULL CHECK (processes >= 0 AND processes <= samples),  -- fresh worker processes that took them
  median_ns  INTEGER CHECK (median_ns >= 0),
  mad_ns     INTEGER CHECK (mad_ns >= 0),
  p95_ns     INTEGER CHECK (p95_ns >= 0),
  p99_ns     INTEGER CHECK (p99_ns >= p95_ns),
  ci_low_ns  INTEGER CHECK (ci_low_ns <= median_ns),
  ci_high_ns INTEGER CHECK (ci_high_ns >= median_ns),
  mixture    INTEGER NOT NULL CHECK (mixture IN (0, 1)),  -- 1: a sum of several provenances, of which the weakest stands here
  bound_ns   INTEGER CHECK (bound_ns >= 0),               -- what the phase takes at least, where the device knows
  cpu_ns     INTEGER CHECK (cpu_ns >= 0),
  taken      REAL CHECK (taken BETWEEN 0 AND 1),
  doubts     TEXT NOT NULL,
  UNIQUE (cell_id, phase, state),
  CHECK ((phase IN ('device_init', 'prepare')) = (state IN ('cold', 'warm'))),
  CHECK ((valid = 1) = (reasons = '' AND doubts = '')),
  CHECK (samples > 0 OR reasons <> ''),
  CHECK ((samples = 0) = (processes = 0)),
  CHECK ((samples = 0) = (median_ns IS NULL) AND (median_ns IS NULL) = (mad_ns IS NULL)),
  CHECK ((median_ns IS NULL) = (p95_ns IS NULL) AND (median_ns IS NULL) = (p99_ns IS NULL)),
  CHECK ((ci_low_ns IS NULL) = (ci_high_ns IS NULL) AND (samples > 0 OR ci_low_ns IS NULL))
) STRICT;

-- Every sample in the order in which it was taken; nothing is dropped. A sample of a batch is the batch's time over its calls.
CREATE TABLE sample (
  measurement_id INTEGER NOT NULL REFERENCES measurement,
  position       INTEGER NOT NULL CHECK (position >= 0),
  ns             INTEGER NOT NULL CHECK (ns >= 0),
  process        INTEGER NOT NULL CHECK (process >= 0),  -- which of the measurement's processes took it
  cpu_ns         INTEGER CHECK (cpu_ns >= 0),            -- as measurement.cpu_ns
  PRIMARY KEY (measurement_id, position)
) STRICT, WITHOUT ROWID;

-- Joules a call: a meter's over many calls, or modelled from the mean time of a call.
CREATE TABLE energy (
  cell_id    INTEGER PRIMARY KEY REFERENCES cell,
  energy_j   REAL CHECK (energy_j >= 0),
  provenance TEXT NOT NULL CHECK (provenance IN ('measured', 'counted', 'modelled', 'fitted', 'published')),
  source     TEXT NOT NULL CHECK (source <> ''),
  valid      INTEGER NOT NULL CHECK (valid IN (0, 1)),
  reasons    TEXT NOT NULL,
  domain     TEXT NOT NULL CHECK (domain <> ''),  -- what the meter or model covers: 'unit', 'package', 'board input'
  idle_subtracted INTEGER NOT NULL CHECK (idle_subtracted IN (0, 1)),  -- 1: what the domain takes anyway is not in energy_j
  mixture    INTEGER NOT NULL CHECK (mixture IN (0, 1)),  -- as that of the time that it follows from
  ci_low_j   REAL CHECK (ci_low_j <= energy_j),           -- 95 % interval; NULL if unknown
  ci_high_j  REAL CHECK (ci_high_j >= energy_j),
  doubts     TEXT NOT NULL,
  CHECK ((ci_low_j IS NULL) = (ci_high_j IS NULL)),
  CHECK ((valid = 1) = (reasons = '' AND doubts = '')),
  CHECK (energy_j IS NOT NULL OR reasons <> '')
) STRICT;

-- One row per (run, workload, unit, phase, state); runs are not collapsed, the newest has the highest run_id.
CREATE VIEW profile_summary AS
SELECT run.run_id, run.platform, cell.workload, cell.unit, unit.backend, measurement.phase, measurement.state,
       measurement.provenance, measurement.valid, measurement.reasons, measurement.notes, measurement.samples,
       measurement.median_ns, measurement.mad_ns, measurement.p95_ns, measurement.p99_ns,
       measurement.ci_low_ns, measurement.ci_high_ns, cell.ops, cell.bytes, measurement.processes,
       measurement.mixture, measurement.bound_ns, measurement.cpu_ns, measurement.taken, cell.host_memory_bytes, cell.device_memory_bytes,
       measurement.doubts
FROM measurement JOIN cell USING (cell_id) JOIN run USING (run_id)
     JOIN unit ON unit.run_id = cell.run_id AND unit.unit = cell.unit
WHERE measurement.state IN ('cold', 'warm', 'steady');

-- The same of what profile_summary has not: phases of calls under other conditions, in `state`.
CREATE VIEW condition_summary AS
SELECT run.run_id, run.platform, cell.workload, cell.unit, unit.backend, measurement.phase, measurement.state,
       measurement.provenance, measurement.valid, measurement.reasons, measurement.notes, measurement.samples,
       measurement.median_ns, measurement.mad_ns, measurement.p95_ns, measurement.p99_ns,
       measurement.ci_low_ns, measurement.ci_high_ns, cell.ops, cell.bytes, measurement.processes,
       measurement.mixture, measurement.bound_ns, measurement.cpu_ns, measurement.taken, cell.host_memory_bytes, cell.device_memory_bytes,
       measurement.doubts
FROM measurement JOIN cell USING (cell_id) JOIN run USING (run_id)
     JOIN unit ON unit.run_id = cell.run_id AND unit.unit = cell.unit
WHERE measurement.state NOT IN ('cold', 'warm', 'steady');

-- One row per (run, unit, phase, sleep_ns).
CREATE VIEW unit_time_summary AS
SELECT run.run_id, run.platform, unit_time.unit, unit.backend, unit_time.phase, unit_time.sleep_ns, 'measured' AS provenance,
       unit_time.valid, unit_time.reasons, unit_time.samples, unit_time.median_ns, unit_time.mad_ns, unit_time.p95_ns, unit_time.p99_ns,
       unit_time.ci_low_ns, unit_time.ci_high_ns, unit_time.doubts
FROM unit_time JOIN run USING (run_id) JOIN unit ON unit.run_id = unit_time.run_id AND unit.unit = unit_time.unit;

-- Of these, hand-overs: one row per (run, unit, sleep_ns).
CREATE VIEW handover_summary AS
SELECT * FROM unit_time_summary WHERE phase = 'handover';

-- One row per (run, workload, unit).
CREATE VIEW energy_summary AS
SELECT cell.run_id, cell.workload, cell.unit, energy.energy_j, energy.provenance, energy.source, energy.valid, energy.reasons,
       energy.domain, energy.idle_subtracted, energy.mixture, energy.ci_low_j, energy.ci_high_j, energy.doubts
FROM energy JOIN cell USING (cell_id);
