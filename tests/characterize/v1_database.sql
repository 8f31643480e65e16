-- A database that version 1 of the format's program made (pirt 0.1.0, fake units), as text: what migrations are tested with.
PRAGMA application_id = 1346982484;
PRAGMA user_version = 1;
PRAGMA foreign_keys=OFF;
BEGIN TRANSACTION;
CREATE TABLE run (
  run_id   INTEGER PRIMARY KEY,
  started  TEXT NOT NULL CHECK (started <> ''),
  finished TEXT CHECK (finished <> ''),
  platform TEXT NOT NULL CHECK (platform <> ''),
  seed     TEXT NOT NULL CHECK (seed <> ''),  -- decimal: 64 bits unsigned do not fit SQLite's integers
  checksum INTEGER NOT NULL
) STRICT;
INSERT INTO run VALUES(1,'2026-11-21T07:34:18Z','2026-11-21T07:34:20Z','board','1',-5881052462666255244);
CREATE TABLE environment (
  run_id INTEGER NOT NULL REFERENCES run,
  key    TEXT NOT NULL CHECK (key <> ''),
  value  TEXT NOT NULL CHECK (value <> ''),
  PRIMARY KEY (run_id, key)
) STRICT, WITHOUT ROWID;
INSERT INTO environment VALUES(1,'assumptions','Watts are made up.');
INSERT INTO environment VALUES(1,'build_type','Release');
INSERT INTO environment VALUES(1,'clock_cost_ns','29.3');
INSERT INTO environment VALUES(1,'clock_resolution_ns','20');
INSERT INTO environment VALUES(1,'compiler','GCC 12.2.0');
INSERT INTO environment VALUES(1,'compiler_flags','-O3 -DNDEBUG');
INSERT INTO environment VALUES(1,'cores_online','2');
INSERT INTO environment VALUES(1,'cores_usable','0,1');
INSERT INTO environment VALUES(1,'cpu_flags','fma sse4_2 avx f16c avx2');
INSERT INTO environment VALUES(1,'cpu_model','AMD EPYC');
INSERT INTO environment VALUES(1,'filter','^sobel$');
INSERT INTO environment VALUES(1,'git_commit','c8aa37f9be4101b543ae57ae498e3fc957a153d7');
INSERT INTO environment VALUES(1,'git_dirty','no');
INSERT INTO environment VALUES(1,'governor_unknown','no cpufreq in /sys (a virtual machine, or a fixed clock)');
INSERT INTO environment VALUES(1,'hypervisor','yes');
INSERT INTO environment VALUES(1,'images','generated, seed 1');
INSERT INTO environment VALUES(1,'images_hash','abf0465fb9ec509a');
INSERT INTO environment VALUES(1,'kernel','6.18.44-fc-v595');
INSERT INTO environment VALUES(1,'load_1m','4.18');
INSERT INTO environment VALUES(1,'memory_mb','24105');
INSERT INTO environment VALUES(1,'mode','quick');
INSERT INTO environment VALUES(1,'os','Debian GNU/Linux 12 (bookworm)');
INSERT INTO environment VALUES(1,'pirt_version','0.1.0');
INSERT INTO environment VALUES(1,'precision','0.02');
INSERT INTO environment VALUES(1,'sqlite_version','3.40.1');
INSERT INTO environment VALUES(1,'steal_percent','0.17');
INSERT INTO environment VALUES(1,'temperature_c_unknown','no readable zone in /sys/class/thermal');
INSERT INTO environment VALUES(1,'turbo_unknown','neither intel_pstate nor cpufreq/boost in /sys');
INSERT INTO environment VALUES(1,'unit.cpu.platform','pirt fake');
INSERT INTO environment VALUES(1,'unit.cpu.version','1');
INSERT INTO environment VALUES(1,'unit.gpu.platform','pirt fake');
INSERT INTO environment VALUES(1,'unit.gpu.version','1');
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
INSERT INTO unit VALUES(1,'cpu',0,'fake','fake device',0,'');
INSERT INTO unit VALUES(1,'gpu',1,'fake','fake device',0,'');
CREATE TABLE cell (
  cell_id      INTEGER PRIMARY KEY,
  run_id       INTEGER NOT NULL,
  workload     TEXT NOT NULL CHECK (workload <> ''),
  unit         TEXT NOT NULL,
  ops          INTEGER CHECK (ops >= 0),        -- operations a call; NULL where they depend on the data
  bytes        INTEGER NOT NULL CHECK (bytes >= 0),
  verification TEXT NOT NULL,                   -- what the comparison with the reference found; "" if none took place
  checksum     INTEGER NOT NULL,
  UNIQUE (run_id, workload, unit),
  FOREIGN KEY (run_id, unit) REFERENCES unit
) STRICT;
INSERT INTO cell VALUES(1,1,'sobel','gpu',74649600,10368000,'after timing: gx: all 2073600 equal',-3157893889389976321);
INSERT INTO cell VALUES(2,1,'sobel','cpu',74649600,10368000,'after timing: gx: all 2073600 equal',-8161160947536815057);
CREATE TABLE measurement (
  measurement_id INTEGER PRIMARY KEY,
  cell_id    INTEGER NOT NULL REFERENCES cell,
  phase      TEXT NOT NULL CHECK (phase IN ('device_init', 'prepare', 'upload', 'launch', 'execute', 'download', 'call')),
  state      TEXT NOT NULL CHECK (state IN ('cold', 'warm', 'steady')),
  provenance TEXT NOT NULL CHECK (provenance IN ('measured', 'counted', 'modelled', 'fitted', 'published')),
  valid      INTEGER NOT NULL CHECK (valid IN (0, 1)),
  reasons    TEXT NOT NULL,
  notes      TEXT NOT NULL,
  samples    INTEGER NOT NULL CHECK (samples >= 0),
  median_ns  INTEGER CHECK (median_ns >= 0),
  mad_ns     INTEGER CHECK (mad_ns >= 0),
  p95_ns     INTEGER CHECK (p95_ns >= 0),
  p99_ns     INTEGER CHECK (p99_ns >= p95_ns),
  ci_low_ns  INTEGER CHECK (ci_low_ns <= median_ns),
  ci_high_ns INTEGER CHECK (ci_high_ns >= median_ns),
  UNIQUE (cell_id, phase, state),
  CHECK ((phase IN ('device_init', 'prepare')) = (state <> 'steady')),
  CHECK ((valid = 1) = (reasons = '')),
  CHECK (samples > 0 OR valid = 0),
  CHECK ((samples = 0) = (median_ns IS NULL) AND (median_ns IS NULL) = (mad_ns IS NULL)),
  CHECK ((median_ns IS NULL) = (p95_ns IS NULL) AND (median_ns IS NULL) = (p99_ns IS NULL)),
  CHECK ((ci_low_ns IS NULL) = (ci_high_ns IS NULL) AND (samples > 0 OR ci_low_ns IS NULL))
) STRICT;
INSERT INTO measurement VALUES(1,1,'device_init','cold','modelled',1,'','',2,1000000,0,1000000,1000000,NULL,NULL);
INSERT INTO measurement VALUES(2,1,'device_init','warm','modelled',1,'','',2,1000000,0,1000000,1000000,NULL,NULL);
INSERT INTO measurement VALUES(3,1,'prepare','cold','modelled',1,'','',2,30474616,0,30474616,30474616,NULL,NULL);
INSERT INTO measurement VALUES(4,1,'prepare','warm','modelled',1,'','',2,22474616,0,22474616,22474616,NULL,NULL);
INSERT INTO measurement VALUES(5,1,'upload','steady','modelled',1,'','',43,1000000,0,1000000,1000000,1000000,1000000);
INSERT INTO measurement VALUES(6,1,'execute','steady','modelled',1,'','precision_not_reached',43,18250005,1303143,19752530,19897110,17069477,18968129);
INSERT INTO measurement VALUES(7,1,'call','steady','modelled',1,'','precision_not_reached',43,19250005,1303143,20752530,20897110,18069477,19968129);
INSERT INTO measurement VALUES(8,2,'device_init','cold','modelled',1,'','',2,1000000,0,1000000,1000000,NULL,NULL);
INSERT INTO measurement VALUES(9,2,'device_init','warm','modelled',1,'','',2,1000000,0,1000000,1000000,NULL,NULL);
INSERT INTO measurement VALUES(10,2,'prepare','cold','modelled',1,'','',2,41848307,0,41848307,41848307,NULL,NULL);
INSERT INTO measurement VALUES(11,2,'prepare','warm','modelled',1,'','',2,33848307,0,33848307,33848307,NULL,NULL);
INSERT INTO measurement VALUES(12,2,'execute','steady','modelled',1,'','precision_not_reached',28,28610663,3845499,37427528,37897269,26011624,32088666);
INSERT INTO measurement VALUES(13,2,'call','steady','modelled',1,'','precision_not_reached',28,28610663,3845499,37427528,37897269,26011624,32088666);
CREATE TABLE sample (
  measurement_id INTEGER NOT NULL REFERENCES measurement,
  position       INTEGER NOT NULL CHECK (position >= 0),
  ns             INTEGER NOT NULL CHECK (ns >= 0),
  PRIMARY KEY (measurement_id, position)
) STRICT, WITHOUT ROWID;
INSERT INTO sample VALUES(1,0,1000000);
INSERT INTO sample VALUES(1,1,1000000);
INSERT INTO sample VALUES(2,0,1000000);
INSERT INTO sample VALUES(2,1,1000000);
INSERT INTO sample VALUES(3,0,30474616);
INSERT INTO sample VALUES(3,1,30474616);
INSERT INTO sample VALUES(4,0,22474616);
INSERT INTO sample VALUES(4,1,22474616);
INSERT INTO sample VALUES(5,0,1000000);
INSERT INTO sample VALUES(5,1,1000000);
INSERT INTO sample VALUES(5,2,1000000);
INSERT INTO sample VALUES(5,3,1000000);
INSERT INTO sample VALUES(5,4,1000000);
INSERT INTO sample VALUES(5,5,1000000);
INSERT INTO sample VALUES(5,6,1000000);
INSERT INTO sample VALUES(5,7,1000000);
INSERT INTO sample VALUES(5,8,1000000);
INSERT INTO sample VALUES(5,9,1000000);
INSERT INTO sample VALUES(5,10,1000000);
INSERT INTO sample VALUES(5,11,1000000);
INSERT INTO sample VALUES(5,12,1000000);
INSERT INTO sample VALUES(5,13,1000000);
INSERT INTO sample VALUES(5,14,1000000);
INSERT INTO sample VALUES(5,15,1000000);
INSERT INTO sample VALUES(5,16,1000000);
INSERT INTO sample VALUES(5,17,1000000);
INSERT INTO sample VALUES(5,18,1000000);
INSERT INTO sample VALUES(5,19,1000000);
INSERT INTO sample VALUES(5,20,1000000);
INSERT INTO sample VALUES(5,21,1000000);
INSERT INTO sample VALUES(5,22,1000000);
INSERT INTO sample VALUES(5,23,1000000);
INSERT INTO sample VALUES(5,24,1000000);
INSERT INTO sample VALUES(5,25,1000000);
INSERT INTO sample VALUES(5,26,1000000);
INSERT INTO sample VALUES(5,27,1000000);
INSERT INTO sample VALUES(5,28,1000000);
INSERT INTO sample VALUES(5,29,1000000);
INSERT INTO sample VALUES(5,30,1000000);
INSERT INTO sample VALUES(5,31,1000000);
INSERT INTO sample VALUES(5,32,1000000);
INSERT INTO sample VALUES(5,33,1000000);
INSERT INTO sample VALUES(5,34,1000000);
INSERT INTO sample VALUES(5,35,1000000);
INSERT INTO sample VALUES(5,36,1000000);
INSERT INTO sample VALUES(5,37,1000000);
INSERT INTO sample VALUES(5,38,1000000);
INSERT INTO sample VALUES(5,39,1000000);
INSERT INTO sample VALUES(5,40,1000000);
INSERT INTO sample VALUES(5,41,1000000);
INSERT INTO sample VALUES(5,42,1000000);
INSERT INTO sample VALUES(6,0,15745560);
INSERT INTO sample VALUES(6,1,18954316);
INSERT INTO sample VALUES(6,2,17015167);
INSERT INTO sample VALUES(6,3,19740944);
INSERT INTO sample VALUES(6,4,15807746);
INSERT INTO sample VALUES(6,5,17839230);
INSERT INTO sample VALUES(6,6,16946862);
INSERT INTO sample VALUES(6,7,19752530);
INSERT INTO sample VALUES(6,8,19897110);
INSERT INTO sample VALUES(6,9,18250005);
INSERT INTO sample VALUES(6,10,18787002);
INSERT INTO sample VALUES(6,11,15706878);
INSERT INTO sample VALUES(6,12,16000192);
INSERT INTO sample VALUES(6,13,19115974);
INSERT INTO sample VALUES(6,14,16421362);
INSERT INTO sample VALUES(6,15,19735318);
INSERT INTO sample VALUES(6,16,18640527);
INSERT INTO sample VALUES(6,17,18218579);
INSERT INTO sample VALUES(6,18,19467060);
INSERT INTO sample VALUES(6,19,18073429);
INSERT INTO sample VALUES(6,20,19578783);
INSERT INTO sample VALUES(6,21,17159053);
INSERT INTO sample VALUES(6,22,19770177);
INSERT INTO sample VALUES(6,23,15584827);
INSERT INTO sample VALUES(6,24,15923502);
INSERT INTO sample VALUES(6,25,18302987);
INSERT INTO sample VALUES(6,26,17686948);
INSERT INTO sample VALUES(6,27,18172090);
INSERT INTO sample VALUES(6,28,17069477);
INSERT INTO sample VALUES(6,29,19708377);
INSERT INTO sample VALUES(6,30,19721311);
INSERT INTO sample VALUES(6,31,19704164);
INSERT INTO sample VALUES(6,32,15694606);
INSERT INTO sample VALUES(6,33,19026595);
INSERT INTO sample VALUES(6,34,18968129);
INSERT INTO sample VALUES(6,35,19045564);
INSERT INTO sample VALUES(6,36,18379369);
INSERT INTO sample VALUES(6,37,16016144);
INSERT INTO sample VALUES(6,38,16570248);
INSERT INTO sample VALUES(6,39,15758148);
INSERT INTO sample VALUES(6,40,15750837);
INSERT INTO sample VALUES(6,41,18330594);
INSERT INTO sample VALUES(6,42,19263851);
INSERT INTO sample VALUES(7,0,16745560);
INSERT INTO sample VALUES(7,1,19954316);
INSERT INTO sample VALUES(7,2,18015167);
INSERT INTO sample VALUES(7,3,20740944);
INSERT INTO sample VALUES(7,4,16807746);
INSERT INTO sample VALUES(7,5,18839230);
INSERT INTO sample VALUES(7,6,17946862);
INSERT INTO sample VALUES(7,7,20752530);
INSERT INTO sample VALUES(7,8,20897110);
INSERT INTO sample VALUES(7,9,19250005);
INSERT INTO sample VALUES(7,10,19787002);
INSERT INTO sample VALUES(7,11,16706878);
INSERT INTO sample VALUES(7,12,17000192);
INSERT INTO sample VALUES(7,13,20115974);
INSERT INTO sample VALUES(7,14,17421362);
INSERT INTO sample VALUES(7,15,20735318);
INSERT INTO sample VALUES(7,16,19640527);
INSERT INTO sample VALUES(7,17,19218579);
INSERT INTO sample VALUES(7,18,20467060);
INSERT INTO sample VALUES(7,19,19073429);
INSERT INTO sample VALUES(7,20,20578783);
INSERT INTO sample VALUES(7,21,18159053);
INSERT INTO sample VALUES(7,22,20770177);
INSERT INTO sample VALUES(7,23,16584827);
INSERT INTO sample VALUES(7,24,16923502);
INSERT INTO sample VALUES(7,25,19302987);
INSERT INTO sample VALUES(7,26,18686948);
INSERT INTO sample VALUES(7,27,19172090);
INSERT INTO sample VALUES(7,28,18069477);
INSERT INTO sample VALUES(7,29,20708377);
INSERT INTO sample VALUES(7,30,20721311);
INSERT INTO sample VALUES(7,31,20704164);
INSERT INTO sample VALUES(7,32,16694606);
INSERT INTO sample VALUES(7,33,20026595);
INSERT INTO sample VALUES(7,34,19968129);
INSERT INTO sample VALUES(7,35,20045564);
INSERT INTO sample VALUES(7,36,19379369);
INSERT INTO sample VALUES(7,37,17016144);
INSERT INTO sample VALUES(7,38,17570248);
INSERT INTO sample VALUES(7,39,16758148);
INSERT INTO sample VALUES(7,40,16750837);
INSERT INTO sample VALUES(7,41,19330594);
INSERT INTO sample VALUES(7,42,20263851);
INSERT INTO sample VALUES(8,0,1000000);
INSERT INTO sample VALUES(8,1,1000000);
INSERT INTO sample VALUES(9,0,1000000);
INSERT INTO sample VALUES(9,1,1000000);
INSERT INTO sample VALUES(10,0,41848307);
INSERT INTO sample VALUES(10,1,41848307);
INSERT INTO sample VALUES(11,0,33848307);
INSERT INTO sample VALUES(11,1,33848307);
INSERT INTO sample VALUES(12,0,21472631);
INSERT INTO sample VALUES(12,1,36326084);
INSERT INTO sample VALUES(12,2,31396050);
INSERT INTO sample VALUES(12,3,28110000);
INSERT INTO sample VALUES(12,4,31343899);
INSERT INTO sample VALUES(12,5,32343709);
INSERT INTO sample VALUES(12,6,31132865);
INSERT INTO sample VALUES(12,7,32256158);
INSERT INTO sample VALUES(12,8,28424215);
INSERT INTO sample VALUES(12,9,22205747);
INSERT INTO sample VALUES(12,10,36149435);
INSERT INTO sample VALUES(12,11,32050223);
INSERT INTO sample VALUES(12,12,28054067);
INSERT INTO sample VALUES(12,13,23584713);
INSERT INTO sample VALUES(12,14,28078050);
INSERT INTO sample VALUES(12,15,22636731);
INSERT INTO sample VALUES(12,16,20288061);
INSERT INTO sample VALUES(12,17,37427528);
INSERT INTO sample VALUES(12,18,28797112);
INSERT INTO sample VALUES(12,19,21799922);
INSERT INTO sample VALUES(12,20,32088666);
INSERT INTO sample VALUES(12,21,24262778);
INSERT INTO sample VALUES(12,22,37897269);
INSERT INTO sample VALUES(12,23,36306962);
INSERT INTO sample VALUES(12,24,32568615);
INSERT INTO sample VALUES(12,25,26100548);
INSERT INTO sample VALUES(12,26,26011624);
INSERT INTO sample VALUES(12,27,22112358);
INSERT INTO sample VALUES(13,0,21472631);
INSERT INTO sample VALUES(13,1,36326084);
INSERT INTO sample VALUES(13,2,31396050);
INSERT INTO sample VALUES(13,3,28110000);
INSERT INTO sample VALUES(13,4,31343899);
INSERT INTO sample VALUES(13,5,32343709);
INSERT INTO sample VALUES(13,6,31132865);
INSERT INTO sample VALUES(13,7,32256158);
INSERT INTO sample VALUES(13,8,28424215);
INSERT INTO sample VALUES(13,9,22205747);
INSERT INTO sample VALUES(13,10,36149435);
INSERT INTO sample VALUES(13,11,32050223);
INSERT INTO sample VALUES(13,12,28054067);
INSERT INTO sample VALUES(13,13,23584713);
INSERT INTO sample VALUES(13,14,28078050);
INSERT INTO sample VALUES(13,15,22636731);
INSERT INTO sample VALUES(13,16,20288061);
INSERT INTO sample VALUES(13,17,37427528);
INSERT INTO sample VALUES(13,18,28797112);
INSERT INTO sample VALUES(13,19,21799922);
INSERT INTO sample VALUES(13,20,32088666);
INSERT INTO sample VALUES(13,21,24262778);
INSERT INTO sample VALUES(13,22,37897269);
INSERT INTO sample VALUES(13,23,36306962);
INSERT INTO sample VALUES(13,24,32568615);
INSERT INTO sample VALUES(13,25,26100548);
INSERT INTO sample VALUES(13,26,26011624);
INSERT INTO sample VALUES(13,27,22112358);
CREATE TABLE energy (
  cell_id    INTEGER PRIMARY KEY REFERENCES cell,
  energy_j   REAL CHECK (energy_j >= 0),
  provenance TEXT NOT NULL CHECK (provenance IN ('measured', 'counted', 'modelled', 'fitted', 'published')),
  source     TEXT NOT NULL CHECK (source <> ''),
  valid      INTEGER NOT NULL CHECK (valid IN (0, 1)),
  reasons    TEXT NOT NULL,
  CHECK ((valid = 1) = (reasons = '')),
  CHECK (energy_j IS NOT NULL OR valid = 0)
) STRICT;
INSERT INTO energy VALUES(1,NULL,'modelled','model: none, unit ''gpu'' states no power; give it with --set gpu.active_w=W',0,'no_power');
INSERT INTO energy VALUES(2,0.11444265200000000581,'modelled','model: active_w 4 W x call; Watts are made up.',1,'');
CREATE VIEW profile_summary AS
SELECT run.run_id, run.platform, cell.workload, cell.unit, unit.backend, measurement.phase, measurement.state,
       measurement.provenance, measurement.valid, measurement.reasons, measurement.notes, measurement.samples,
       measurement.median_ns, measurement.mad_ns, measurement.p95_ns, measurement.p99_ns,
       measurement.ci_low_ns, measurement.ci_high_ns, cell.ops, cell.bytes
FROM measurement JOIN cell USING (cell_id) JOIN run USING (run_id)
     JOIN unit ON unit.run_id = cell.run_id AND unit.unit = cell.unit;
CREATE VIEW energy_summary AS
SELECT cell.run_id, cell.workload, cell.unit, energy.energy_j, energy.provenance, energy.source, energy.valid, energy.reasons
FROM energy JOIN cell USING (cell_id);
COMMIT;
