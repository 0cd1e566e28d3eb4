/* BodyCoupling: what the velocity operator has between the nodes and the rigid velocities of bodies, for its
   preconditioner.

   In the unknowns of P (nodes, relative to the body at those that follow one; rigid velocities) the operator P^T A P
   has beside the matrix of the nodes

     E_jk = sum_m A_jm R_k(x_m) - G_jk               in the row of node j,   m: nodes that lie in body k or follow it
     O_kl = sum_im R_k(x_i)^T A_im R_l(x_m) - ...    in the rows of body k,  i: likewise, of body k

   and E^T in the rows of bodies, but for the convection, which a preconditioner need not turn round. G, and the dots,
   are the penalty's (penaltyterm.h). R is linear in the place, so E takes dim + 1 numbers a pair of node and body: sum
   a and sum a (x - X). With E and O the preconditioner of the velocity is one symmetric block Gauss-Seidel sweep over
   bodies, nodes, bodies (Saad 2003, ch. 4.1); without them a body and the fluid that it moves know of each other
   through the Krylov method alone, which takes up to twice as many iterations (runs/studies/flow-solver, "Bodies and
   the fluid around them"). E is kept by the rows of own nodes; sums over bodies are for ConstraintDeliverRigid. From E
   come the blocks of single bodies, too. */
#pragma once
#include "projection.h"
#include "flow/flow.h"
#include "solve/penaltyterm.h"

typedef struct _p_BodyCoupling *BodyCoupling;

PetscErrorCode BodyCouplingCreate(Flow, Constraint, BodyCoupling *);
PetscErrorCode BodyCouplingDestroy(BodyCoupling *);

/* Mark, in marked [nnode_all], the nodes whose rows and columns of the matrix BodyCouplingUpdate will want. Local. */
PetscErrorCode BodyCouplingMarkNodes(Constraint, PetscBool marked[]);
/* The body whose rigid velocities move local node i, or -1; at a wall none */
static inline PetscInt BodyCouplingGetMover(const ConstraintView *c, PetscInt i)
{
  const PetscInt  k    = ConstraintGetMover(c, i);
  const PetscBool wall = (PetscBool)(c->node_body[i] < 0 && c->fixed[i] == (1 << c->loc->dim) - 1);

  return k >= 0 && ConstraintHasUnknown(c, k) && !wall ? k : -1;
}

/* Of the present matrix, bodies and penalty; penalty may be NULL. rows: of FlowGatherRows with those nodes marked, or
   NULL: the matrix of FlowGetMatrix. own [nbodies][nr][nr]: what O is for k = l, of the rows
   of own nodes (to be summed over ranks), without the penalty's H; borrowed, valid until the next update. Collective.
   */
PetscErrorCode BodyCouplingUpdate(BodyCoupling, const Rows *rows, const PenaltyTerm *penalty, const PetscReal *own[]);
/* The same, in space and on one rank, where E is kept elsewhere: blocks [n][nr][nr] of O, each once, of pairs of local
   bodies, two [n][2], without what the penalty has in rows of bodies */
PetscErrorCode BodyCouplingSetBlocks(BodyCoupling, const PenaltyTerm *penalty, PetscInt n, const PetscInt two[],
                                     const PetscReal block[], const PetscReal *own[]);
/* b -= E U at own nodes, b [own nodes][dim]; U [nlocal][nr] rigid velocities by the local numbers of the constraint,
   zero where they are not unknown. Local. */
PetscErrorCode BodyCouplingSubtract(BodyCoupling, const PetscReal U[], PetscReal b[]);
/* rigid -= E^T x + O U, [nlocal][nr], of own nodes; U as above. Local. */
PetscErrorCode BodyCouplingAnswer(BodyCoupling, const PetscReal x[], const PetscReal U[], PetscReal rigid[]);

/* E by own nodes, for who multiplies it elsewhere: pairs [start[i], start[i + 1]) of node[i] with local bodies, sum a
   and sum a (x - X) [dim + 1] of each; and rigid -= O U alone. Borrowed until the next update. Local. */
struct _p_BodyCouplingView {
  PetscInt         nnode;
  const PetscInt  *node, *start, *body;
  const PetscReal *e;
};
void           BodyCouplingGetView(BodyCoupling, struct _p_BodyCouplingView *);
PetscErrorCode BodyCouplingAnswerBodies(BodyCoupling, const PetscReal U[], PetscReal rigid[]);
