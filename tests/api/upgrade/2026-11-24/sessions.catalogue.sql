BEGIN TRANSACTION;
CREATE TABLE rig_catalogue (
	version BIGINT NOT NULL, 
	root VARCHAR COLLATE "BINARY" NOT NULL, 
	PRIMARY KEY (version)
);
INSERT INTO "rig_catalogue" VALUES(1,'/tmp/h14left/sessions');
CREATE TABLE rig_cause (
	"key" VARCHAR COLLATE "BINARY" NOT NULL, 
	session VARCHAR COLLATE "BINARY" NOT NULL, 
	at VARCHAR COLLATE "BINARY" NOT NULL, 
	subject VARCHAR COLLATE "BINARY" NOT NULL, 
	site VARCHAR COLLATE "BINARY" NOT NULL, 
	name VARCHAR COLLATE "BINARY" NOT NULL, 
	statement VARCHAR COLLATE "BINARY" NOT NULL, 
	confidence DOUBLE NOT NULL, 
	PRIMARY KEY ("key")
);
INSERT INTO "rig_cause" VALUES('first/cause 1 friction','first','2026-11-29T03:13:10.988901Z','S01','forearm','friction','it is friction',0.97);
CREATE TABLE rig_diagnosis (
	"key" VARCHAR COLLATE "BINARY" NOT NULL, 
	session VARCHAR COLLATE "BINARY" NOT NULL, 
	at VARCHAR COLLATE "BINARY" NOT NULL, 
	subject VARCHAR COLLATE "BINARY" NOT NULL, 
	site VARCHAR COLLATE "BINARY" NOT NULL, 
	file VARCHAR COLLATE "BINARY" NOT NULL, 
	verdict VARCHAR COLLATE "BINARY" NOT NULL, 
	statement VARCHAR COLLATE "BINARY" NOT NULL, 
	explained_share DOUBLE, 
	causes JSON NOT NULL, 
	PRIMARY KEY ("key")
);
INSERT INTO "rig_diagnosis" VALUES('first/diagnosis/diagnosis.json','first','2026-11-29T03:13:10.988901Z','S01','forearm','diagnosis/diagnosis.json','explained','the simulation lacks friction',0.8,'["friction"]');
CREATE TABLE rig_model (
	"key" VARCHAR COLLATE "BINARY" NOT NULL, 
	session VARCHAR COLLATE "BINARY" NOT NULL, 
	at VARCHAR COLLATE "BINARY" NOT NULL, 
	subject VARCHAR COLLATE "BINARY" NOT NULL, 
	site VARCHAR COLLATE "BINARY" NOT NULL, 
	file VARCHAR COLLATE "BINARY" NOT NULL, 
	law VARCHAR COLLATE "BINARY" NOT NULL, 
	parameters JSON NOT NULL, 
	"rmse_N" DOUBLE, 
	held_out_max_error_percent DOUBLE, 
	depth_mm DOUBLE, 
	"force_N" DOUBLE, 
	causes JSON NOT NULL, 
	PRIMARY KEY ("key")
);
INSERT INTO "rig_model" VALUES('first/fit/model.json','first','2026-11-29T03:13:10.988183Z','S01','forearm','fit/model.json','index','{"a_N_mm": 0.12, "b_per_mm": 0.22, "damping_N_s_mm": 0.01}',0.0,NULL,1.00487048075753619973e+01,11.0,'[]');
CREATE TABLE rig_person (
	subject VARCHAR COLLATE "BINARY" NOT NULL, 
	name VARCHAR COLLATE "BINARY" NOT NULL, 
	entered VARCHAR COLLATE "BINARY" NOT NULL, 
	PRIMARY KEY (subject)
);
INSERT INTO "rig_person" VALUES('S01','Ann Example','2026-11-29T03:13:11Z');
CREATE TABLE rig_session (
	"key" VARCHAR COLLATE "BINARY" NOT NULL, 
	session VARCHAR COLLATE "BINARY" NOT NULL, 
	at VARCHAR COLLATE "BINARY" NOT NULL, 
	subject VARCHAR COLLATE "BINARY" NOT NULL, 
	site VARCHAR COLLATE "BINARY" NOT NULL, 
	id VARCHAR COLLATE "BINARY" NOT NULL, 
	kind VARCHAR COLLATE "BINARY" NOT NULL, 
	created VARCHAR COLLATE "BINARY" NOT NULL, 
	software VARCHAR COLLATE "BINARY" NOT NULL, 
	protocol VARCHAR COLLATE "BINARY" NOT NULL, 
	trials BIGINT NOT NULL, 
	samples BIGINT NOT NULL, 
	dropped BIGINT NOT NULL, 
	quality VARCHAR COLLATE "BINARY" NOT NULL, 
	remarks JSON NOT NULL, 
	PRIMARY KEY ("key")
);
INSERT INTO "rig_session" VALUES('first','first','2026-11-20T10:00:00.000000Z','S01','forearm','first','capture','2026-11-20T10:00:00+00:00','tissue-rig 0.1.0','indentation',1,1500,0,'good','[]');
CREATE TABLE rig_stamp (
	session VARCHAR COLLATE "BINARY" NOT NULL, 
	stamp VARCHAR COLLATE "BINARY", 
	PRIMARY KEY (session)
);
INSERT INTO "rig_stamp" VALUES('first','daf545ecd798e1aabc29d06d9598dfab06772fdbefc28405d23b56d598e3bb50');
CREATE TABLE rig_threshold (
	"key" VARCHAR COLLATE "BINARY" NOT NULL, 
	session VARCHAR COLLATE "BINARY" NOT NULL, 
	at VARCHAR COLLATE "BINARY" NOT NULL, 
	subject VARCHAR COLLATE "BINARY" NOT NULL, 
	site VARCHAR COLLATE "BINARY" NOT NULL, 
	recording VARCHAR COLLATE "BINARY" NOT NULL, 
	"force_N" DOUBLE, 
	"up_to_N" DOUBLE NOT NULL, 
	PRIMARY KEY ("key")
);
INSERT INTO "rig_threshold" VALUES('first/track_001.threshold.json','first','2026-11-29T03:13:10.993019Z','S01','forearm','track_001.mcap',7.25,12.0);
CREATE TABLE rig_trial (
	"key" VARCHAR COLLATE "BINARY" NOT NULL, 
	session VARCHAR COLLATE "BINARY" NOT NULL, 
	at VARCHAR COLLATE "BINARY" NOT NULL, 
	subject VARCHAR COLLATE "BINARY" NOT NULL, 
	site VARCHAR COLLATE "BINARY" NOT NULL, 
	name VARCHAR COLLATE "BINARY" NOT NULL, 
	file VARCHAR COLLATE "BINARY" NOT NULL, 
	speed_mm_s DOUBLE, 
	depth_mm DOUBLE, 
	"peak_force_N" DOUBLE, 
	outcome VARCHAR COLLATE "BINARY" NOT NULL, 
	quality VARCHAR COLLATE "BINARY" NOT NULL, 
	reasons JSON NOT NULL, 
	PRIMARY KEY ("key")
);
INSERT INTO "rig_trial" VALUES('first/trial_001','first','2026-11-20T10:00:00.000000Z','S01','forearm','trial_001','trial_001.mcap',10.0,8.0,4.5,'complete','good','[]');
CREATE TABLE rig_work (
	"key" VARCHAR COLLATE "BINARY" NOT NULL, 
	session VARCHAR COLLATE "BINARY" NOT NULL, 
	at VARCHAR COLLATE "BINARY" NOT NULL, 
	subject VARCHAR COLLATE "BINARY" NOT NULL, 
	site VARCHAR COLLATE "BINARY" NOT NULL, 
	kind VARCHAR COLLATE "BINARY" NOT NULL, 
	file VARCHAR COLLATE "BINARY" NOT NULL, 
	PRIMARY KEY ("key")
);
INSERT INTO "rig_work" VALUES('first/capture:session.json','first','2026-11-20T10:00:00.000000Z','S01','forearm','capture','session.json');
INSERT INTO "rig_work" VALUES('first/fit:fit/fit.json','first','2026-11-29T03:13:10.988379Z','S01','forearm','fit','fit/fit.json');
INSERT INTO "rig_work" VALUES('first/diagnose:diagnosis/diagnosis.json','first','2026-11-29T03:13:10.988901Z','S01','forearm','diagnose','diagnosis/diagnosis.json');
INSERT INTO "rig_work" VALUES('first/threshold:track_001.threshold.json','first','2026-11-29T03:13:10.993019Z','S01','forearm','threshold','track_001.threshold.json');
CREATE INDEX ix_rig_session_session ON rig_session (session);
CREATE INDEX ix_rig_session_subject ON rig_session (subject);
CREATE INDEX ix_rig_session_at ON rig_session (at);
CREATE INDEX ix_rig_trial_session ON rig_trial (session);
CREATE INDEX ix_rig_trial_at ON rig_trial (at);
CREATE INDEX ix_rig_trial_subject ON rig_trial (subject);
CREATE INDEX ix_rig_model_subject ON rig_model (subject);
CREATE INDEX ix_rig_model_session ON rig_model (session);
CREATE INDEX ix_rig_model_at ON rig_model (at);
CREATE INDEX ix_rig_diagnosis_subject ON rig_diagnosis (subject);
CREATE INDEX ix_rig_diagnosis_at ON rig_diagnosis (at);
CREATE INDEX ix_rig_diagnosis_session ON rig_diagnosis (session);
CREATE INDEX ix_rig_cause_at ON rig_cause (at);
CREATE INDEX ix_rig_cause_subject ON rig_cause (subject);
CREATE INDEX ix_rig_cause_session ON rig_cause (session);
CREATE INDEX ix_rig_threshold_at ON rig_threshold (at);
CREATE INDEX ix_rig_threshold_session ON rig_threshold (session);
CREATE INDEX ix_rig_threshold_subject ON rig_threshold (subject);
CREATE INDEX ix_rig_work_session ON rig_work (session);
CREATE INDEX ix_rig_work_at ON rig_work (at);
CREATE INDEX ix_rig_work_subject ON rig_work (subject);
COMMIT;
