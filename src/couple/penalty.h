/* Penalty: boundary method `penalty`.

   The velocity in the body's part of a cell is held at the rigid velocity by a force per volume sigma (u - U - w x r),
   sigma = a mu/h^2 + b rho_f c_t with the size h of the cell and, where it varies, its mean mu. With a = 200, b = 12
   the thin layer in which the flow adapts compensates the missing wall within the cell, so that the body keeps its true
   radius (study runs/studies/boundary); in space, where a surface cuts cells at two angles, with a = 280. Parts of
   cells: cutcells.h. Nodes all of whose cells lie inside the body move rigidly (strong nodes), which keeps light bodies
   and the operator well conditioned. Angot, Bruneau, Fabrie 1999 (volume penalisation); Glowinski, Pan, Hesla, Joseph
   1999 (fictitious fluid inside). */
#pragma once
#include "bodies/bodies.h"
#include "flow/flow.h"
#include "indicator.h"
#include "cutcells.h"
#include "solve/penaltyterm.h"

typedef struct _p_Penalty *Penalty;

PetscErrorCode PenaltyCreate(Flow, Bodies, Penalty *);
PetscErrorCode PenaltyDestroy(Penalty *);
PetscErrorCode PenaltyView(Penalty, PetscViewer);

/* Bodies drawn at X, q in the step that FlowBeginStep began, rigid velocities about the points P: claims the strong
   nodes, computes the penalty and hands its scalar part to the flow. Bodies k with omit[k] (NULL: none) are no
   concern of the penalty. Collective. */
PetscErrorCode PenaltyUpdateGeometry(Penalty, PetscReal (*X)[3], PetscReal (*q)[4], PetscReal (*P)[3],
                                     const PetscBool omit[], Indicator);
/* The viscosity of the flow has changed since (-flow_rheology): the same parts, held with that of their cells.
   *changed: they are anew, with this rank's part of H as after PenaltyUpdateGeometry. Collective. */
PetscErrorCode PenaltyStiffen(Penalty, PetscBool *changed);
/* The rest of the penalty of the last PenaltyUpdateGeometry. Borrowed. */
PetscErrorCode PenaltyGetTerm(Penalty, const PenaltyTerm **);

/* What the penalty exerts on the flow at prescribed components (fixed: bit mask [nnode_all]), where a body reaches a
   wall: out [3] += sum of Pen u - G U over them, to be summed over ranks. u [nnode_all][dim], U [nbodies][nr] all
   rigid velocities. Local. */
PetscErrorCode PenaltyAddPrescribed(Penalty, const unsigned char fixed[], const PetscReal u[], const PetscReal U[],
                                    PetscReal out[3]);
/* Nodes whose u it reads, ascending, to be freed. Local. */
PetscErrorCode PenaltyListPrescribed(Penalty, const unsigned char fixed[], PetscInt *n, PetscInt *node[]);

/* Bodies whose surface moves beside the rigid motion: the penalty holds cut cells at R U + s, s(ctx, k, node, v
   [dim]) of body k as continued to a node, for those whose group has slip. With Pen of the last PenaltyUpdateGeometry
   or PenaltyStiffen: force [nnode_all][dim] += Pen s of own cells, on the flow, and body [nbodies][nr] += R^T Pen s,
   to be summed over ranks, which the bodies lose. Kept for PenaltyAddPrescribed and PenaltyAddSlipPower: power
   [nbodies] += s . f and penalty_force [nbodies] += (u - R U) . Pen s (NULL: not), f the force of the penalty on the
   flow. Local. */
typedef PetscErrorCode (*PenaltySlip)(void *ctx, PetscInt k, PetscInt node, PetscReal v[]);
PetscErrorCode PenaltySetSlip(Penalty, PenaltySlip, void *ctx, PetscReal force[], PetscReal body[]);
PetscErrorCode PenaltyAddSlipPower(Penalty, const PetscReal u[], const PetscReal U[], PetscReal power[],
                                   PetscReal penalty_force[]);

/* The parts of cells in bodies. Borrowed. */
PetscErrorCode PenaltyGetCutCells(Penalty, CutCells *);
