/* Log classes, stages and events of the program: one place, so that -log_view reads like the algorithm.
   Event names have at most 16 characters. */
#pragma once
#include <petscsys.h>

extern PetscLogStage TB_STAGE_SETUP, TB_STAGE_FLOW, TB_STAGE_BODIES, TB_STAGE_OUTPUT;
extern PetscLogEvent TB_FLOW_ASSEMBLE; /* FlowAssemble: velocity matrix of the step, without convection */
extern PetscLogEvent TB_FLOW_CONVECT;  /* FlowConvect: the same with convection */
extern PetscLogEvent TB_FLOW_RHS;      /* FlowRhs: old-time terms and body force */
extern PetscLogEvent TB_FLOW_DIV;      /* FlowDiv: B u and B^T p */
extern PetscLogEvent TB_VEL_SWEEP;     /* VelocitySweep: SOR sweeps or one incomplete factorisation applied, over all
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
extern PetscLogEvent TB_OUTPUT;        /* Output */
extern PetscLogEvent TB_CHECKPOINT;    /* Checkpoint: written or loaded */

/* Register everything; called once after PetscInitialize. Not collective. */
PetscErrorCode LogInitialize(void);
