/* Rung: how the flow sees the surface of a body (-couple_method), as a table of operations. A new one is a file
   with its table and a line in rung.c; nothing else knows a name. Operations that are NULL do nothing; all are
   collective. `rung` is what create made. */
#pragma once
#include "couple/couple.h"
#include "solve/penaltyterm.h"

#define RUNG_COUNTS 5

typedef struct {
  const char *name;
  PetscBool   moves;  /* moves nodes of the mesh itself, so that -mesh_deform cannot */
  PetscBool   soft;   /* nodes of bodies have velocities of their own: what a solve leaves may be owed (owed.c) */
  PetscInt    reach;  /* cells beyond those of a rank within which it is to know bodies */
  PetscReal   recess; /* by which a film in space counts as wider, in cells; see CoupleGetRecess */
  /* marks groups whose bodies all ranks are to know (BodiesSetEverywhere) */
  PetscErrorCode (*spread)(Mesh, Bodies);
  /* names what it will count in c->count, at most RUNG_COUNTS numbers */
  PetscErrorCode (*create)(Couple, void **rung);
  /* Bodies are at c->X, c->q, c->P: claim the nodes that move rigidly in c->mark, prepare the rung's own terms, set
     c->hollow. *terms: these terms, for the solver, the constraint and the forces; NULL: none */
  PetscErrorCode (*draw)(Couple, void *rung, const PenaltyTerm **terms);
  /* The viscosity varies and may have changed since: terms and what the flow has of them again, in place */
  PetscErrorCode (*stiffen)(void *rung, PetscBool *changed);
  /* What these terms exert at prescribed components (fixed [nnode_all] bits), added to out [3] of this rank */
  PetscErrorCode (*force)(Couple, void *rung, const unsigned char fixed[], PetscReal out[3]);
  /* the mesh has another form as a whole */
  PetscErrorCode (*moved)(void *rung);
  /* cells are made anew (CoupleLeave, CoupleRemesh): what it keeps of the old mesh, and what another one, just made for
     the new mesh, is given; it may take over the old mesh */
  PetscErrorCode (*leave)(void *rung, void **left);
  PetscErrorCode (*arrive)(void *rung, void **left, Mesh *old);
  /* bodies have moved, the step is about to be accepted */
  PetscErrorCode (*accept)(Couple, void *rung);
  PetscErrorCode (*state)(void *rung, State);
  PetscErrorCode (*view)(void *rung, PetscViewer);
  PetscErrorCode (*destroy)(void *rung);
} Rung;

extern const Rung        rung_nodal, rung_penalty, rung_snap;
extern const Rung *const rungs[]; /* NULL-terminated; the first is the default */

/* -couple_method */
PetscErrorCode RungChoose(const Rung **);
