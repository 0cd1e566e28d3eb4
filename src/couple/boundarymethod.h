/* BoundaryMethod: how the flow sees the surface of a body (-couple_method), as a table of operations. A new one is a
   file with its table and a line in boundarymethods.c; nothing else knows a name. Operations that are NULL do nothing;
   all are collective. `method` is what create made. */
#pragma once
#include "couple/couple.h"
#include "solve/penaltyterm.h"

#define METHOD_COUNTS 5

struct _n_AlignMotion;

typedef struct {
  const char *name;
  PetscBool   moves_nodes;     /* moves nodes of the mesh itself, so that -mesh_deform cannot */
  PetscBool   own_velocities;  /* nodes of bodies have their own: the residual of a step is carried over (carry.c) */
  PetscInt    reach;           /* cells beyond those of a rank within which it is to know bodies */
  PetscReal   film_gap_offset; /* by which a film in space counts as wider, in cells; see CoupleGetFilmGapOffset */
  /* marks groups whose bodies all ranks are to know (BodiesSetEverywhere) */
  PetscErrorCode (*spread)(Mesh, Bodies);
  /* names what it will count in c->method.count, at most METHOD_COUNTS numbers, and a bound of steps in c->method.bound
     (which keeps what it has counted when the method is made anew) */
  PetscErrorCode (*create)(Couple, void **method);
  /* Bodies are at c->rigid.X, q, P: assign the nodes that move rigidly in c->indicator, prepare the method's own terms,
     set c->method.inactive_inside. *terms: these terms, for the solver, the constraint and the forces; NULL: none */
  PetscErrorCode (*update)(Couple, void *method, const PenaltyTerm **terms);
  /* The viscosity varies and may have changed since: terms and what the flow has of them again, in place */
  PetscErrorCode (*stiffen)(void *method, PetscBool *changed);
  /* What these terms exert at prescribed components (fixed [nnode_all] bits), added to out [3] of this rank */
  PetscErrorCode (*force)(Couple, void *method, const unsigned char fixed[], PetscReal out[3]);
  /* its Penalty, for surfaces that move beside the rigid motion (slip.c) */
  struct _p_Penalty *(*penalty)(void *method);
  /* calls this with what moves, where it moves nodes (alignbodies.h) */
  PetscErrorCode (*carry)(void *method, PetscErrorCode (*)(void *ctx, const struct _n_AlignMotion *), void *ctx);
  /* what lines the mesh up with bodies, for others with surfaces (aligned.h) */
  struct _p_AlignDriver *(*driver)(void *method);
  /* points x [n][2], borrowed, of surfaces of bodies that others touch there: a vertex is to lie on each */
  PetscErrorCode (*points)(void *method, PetscInt n, const PetscReal x[]);
  /* the mesh has another form as a whole */
  PetscErrorCode (*mesh_updated)(void *method);
  /* cells are made anew (CoupleBeforeRemesh, CoupleAfterRemesh): what it keeps of the old mesh, and what another one,
     just made for the new mesh, is given; it may take over the old mesh */
  PetscErrorCode (*before_remesh)(void *method, void **left);
  PetscErrorCode (*after_remesh)(void *method, void **left, Mesh *old);
  /* bodies have moved, the step is about to be accepted */
  PetscErrorCode (*accept)(Couple, void *method);
  PetscErrorCode (*state)(void *method, State);
  PetscErrorCode (*view)(void *method, PetscViewer);
  PetscErrorCode (*destroy)(void *method);
} BoundaryMethod;

extern const BoundaryMethod        method_nodal, method_penalty, method_aligned;
extern const BoundaryMethod *const methods[]; /* NULL-terminated; the first is the default */

/* -couple_method */
PetscErrorCode BoundaryMethodChoose(const BoundaryMethod **);
