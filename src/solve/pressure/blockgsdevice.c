/* BlockGS where vectors lie in the memory of a device: see blockgs.h. */
#include "compat.h"
#include "blockgsimpl.h"
#include "../devicevec.h"

static PetscErrorCode fetch_ghosts(const BlockGS *g, const PetscReal x[], PetscReal ghost[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFBcastBegin(g->sf, g->unit, x, ghost, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(g->sf, g->unit, x, ghost, MPI_REPLACE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSMultiplyOnDevice(const BlockGS *g, Vec x, Vec y)
{
  const PetscReal *xa, one = 1;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGetRead(g->queue, x, &xa));
  PetscCall(DeviceVecGetWrite(g->queue, y, &ya));
  if (g->sf) {
    PetscCallDevice(g->queue, (*g->queue->run->combine)(g->queue, (size_t)(g->n * g->nk), 1, &xa, &one, NULL, g->all));
    PetscCall(fetch_ghosts(g, xa, g->all + g->n * g->nk));
  }
  PetscCallDevice(g->queue, (*g->queue->run->multiply_rows)(g->queue, g->rows, g->sf ? g->all : xa, ya));
  PetscCall(VecRestoreArrayWriteAndMemType(y, &ya));
  PetscCall(VecRestoreArrayReadAndMemType(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSGetRows(Mat shell, struct _p_RowsView *v)
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  *v = (struct _p_RowsView){.start   = g->start,
                            .column  = g->column,
                            .at      = g->pool.at,
                            .exact   = g->pool.keep ? g->pool.exact : NULL,
                            .single  = g->pool.value,
                            .inverse = g->inverse,
                            .n       = g->n,
                            .nk      = g->nk,
                            .nblock  = g->pool.used,
                            .nghost  = g->sf ? g->nghost : 0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSSetDevice(Mat shell, const DeviceQueue *queue, const DeviceRows *rows, PetscReal all[])
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  g->queue = queue;
  g->rows  = rows;
  g->all   = all;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSFetchGhosts(Mat shell, const PetscReal x[], PetscReal ghost[])
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(fetch_ghosts(g, x, ghost));
  PetscFunctionReturn(PETSC_SUCCESS);
}
