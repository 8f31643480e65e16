-- From version 1 (v1.sql) to version 2: the old tables are in `old`, the new ones, empty, in `main`.
--
-- Version 1 took set-up samples in a process each and all others of a row in one; its energies were all modelled, from watts above
-- idle. The kinds of its facts are set afterwards, by the rule that new facts follow; the checksums as well.
INSERT INTO main.run (run_id, started, finished, platform, seed, plan, checksum)
SELECT run_id, started, finished, platform, seed, NULL, 0 FROM old.run;

INSERT INTO main.environment (run_id, key, value, kind)
SELECT run_id, key, value, 'information' FROM old.environment;

INSERT INTO main.unit (run_id, unit, ordinal, backend, device, device_is_cpu, cores)
SELECT run_id, unit, ordinal, backend, device, device_is_cpu, cores FROM old.unit;

INSERT INTO main.cell (cell_id, run_id, workload, unit, ops, bytes, verification, checksum)
SELECT cell_id, run_id, workload, unit, ops, bytes, verification, 0 FROM old.cell;

INSERT INTO main.measurement (measurement_id, cell_id, phase, state, provenance, valid, reasons, notes, samples, processes,
                              median_ns, mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns)
SELECT measurement_id, cell_id, phase, state, provenance, valid, reasons, notes, samples,
       CASE state WHEN 'steady' THEN min(samples, 1) ELSE samples END,
       median_ns, mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns
FROM old.measurement;

INSERT INTO main.sample (measurement_id, position, ns, process)
SELECT measurement_id, position, ns, CASE state WHEN 'steady' THEN 0 ELSE position END
FROM old.sample JOIN old.measurement USING (measurement_id);

INSERT INTO main.energy (cell_id, energy_j, provenance, source, valid, reasons, domain, idle_subtracted)
SELECT cell_id, energy_j, provenance, source, valid, reasons, 'unit', 1 FROM old.energy;
