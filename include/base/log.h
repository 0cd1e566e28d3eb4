/* Log classes, stages and events of the program: one place, so that -log_view reads like the algorithm.
   Event names have at most 16 characters. */
#pragma once
#include <petscsys.h>

extern PetscLogStage TB_STAGE_SETUP, TB_STAGE_FLOW, TB_STAGE_BODIES, TB_STAGE_OUTPUT;
extern PetscLogEvent TB_FLOW_ASSEMBLE; /* FlowAssemble: velocity matrix of the step, without convection */
extern PetscLogEvent TB_FLOW_CONVECT;  /* FlowConvect: the same with convection */
extern PetscLogEvent TB_FLOW_RHS;      /* FlowRhs: old-time terms and body force */
extern PetscLogEvent TB_FLOW_STRESS;   /* FlowStress: conformation of viscoelastic fluids over a step */
extern PetscLogEvent TB_FLOW_DIV;      /* FlowDiv: B u and B^T p */
extern PetscLogEvent TB_VEL_SMOOTHER;  /* VelocitySmoother: SOR sweeps or one incomplete factorisation applied, over all
                                          components at once */
extern PetscLogEvent TB_VEL_FACTOR;    /* VelocityFactor: that factorisation computed */
extern PetscLogEvent TB_VEL_MULT;      /* VelocityMult: projected velocity operator */
extern PetscLogEvent TB_PRES_BUILD;    /* PressureBuild: projected pressure operator */
extern PetscLogEvent TB_FLOW_SOLVE;    /* FlowSolve: the whole linear solve of a step */
extern PetscLogEvent TB_MARK;          /* BodyMark: which nodes and cells a body touches */
extern PetscLogEvent TB_PROJECT;       /* Projection: rows of the projection onto rigid motion */
extern PetscLogEvent TB_FORCE;         /* BodyForce */
extern PetscLogEvent TB_ADVANCE;       /* BodyAdvance */
extern PetscLogEvent TB_CONTACT;       /* Contact */
extern PetscLogEvent TB_SEARCH;        /* ContactSearch: which bodies are near each other */
extern PetscLogEvent TB_MIGRATE;       /* BodyMigrate: bodies go to their owners and come as ghosts */
extern PetscLogEvent TB_SYNC;          /* BodySync: positions and velocities of ghosts */
extern PetscLogEvent TB_OUTPUT;        /* Output */
extern PetscLogEvent TB_CHECKPOINT;    /* Checkpoint: written or loaded */

/* Tell the user something true and worth knowing that does not stop the run: prints "remark: <text>" and keeps it for
   summary.json. Text as of printf, without "remark:" and without a line break; the same text a second time is dropped,
   as is everything after the 64th. Collective on the communicator of the run (runcomm.h), same text on all ranks. */
PetscErrorCode LogRemark(const char format[], ...) __attribute__((format(printf, 1, 2)));
/* Meanwhile remarks are dropped, and what reports the course of a solve says nothing. The same on all ranks. */
void      LogMute(PetscBool mute);
PetscBool LogIsMute(void);
/* All remarks so far. Borrowed. Not collective. */
PetscErrorCode LogGetRemarks(PetscInt *n, const char *const *text[]);
/* Forget the remarks (before PetscFinalize). */
PetscErrorCode LogFinalize(void);

/* Register everything; called once after PetscInitialize. Not collective. */
PetscErrorCode LogInitialize(void);
