/* ScalarColumns: see scalarcolumns.h. */
#include "compat.h"
#include "scalarcolumns.h"

#define NAME 160

/* Calls put for every column of every scalar: name (NULL in later calls: not wanted) and value */
typedef PetscErrorCode (*Put)(void *ctx, const char name[], PetscReal value);

static PetscErrorCode put_boundaries(const CoupleScalar *s, Mesh mesh, Put put, void *ctx)
{
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryCount(mesh, &n));
  for (PetscInt b = 0; b < n; b++) {
    const char *boundary;
    char        name[NAME];

    if (!s->open[b]) continue;
    PetscCall(MeshGetBoundaryName(mesh, b, &boundary));
    PetscCall(PetscSNPrintf(name, sizeof(name), "scalar_flux_%s_%s", s->par->name, boundary));
    PetscCall((*put)(ctx, name, s->boundary[b]));
    if (!s->nusselt) continue;
    PetscCall(PetscSNPrintf(name, sizeof(name), "nusselt_%s_%s", s->par->name, boundary));
    PetscCall((*put)(ctx, name, s->nusselt[b]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode put_groups(const CoupleScalar *s, Put put, void *ctx)
{
  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    char name[NAME];

    if (!s->group_name[g]) continue;
    PetscCall(PetscSNPrintf(name, sizeof(name), "scalar_from_%s_%s", s->par->name, s->group_name[g]));
    PetscCall((*put)(ctx, name, s->group[g]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode put_all(Couple couple, Mesh mesh, Put put, void *ctx)
{
  PetscInt            n;
  const CoupleScalar *scalar;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetScalars(couple, &n, &scalar));
  for (PetscInt i = 0; i < n; i++) {
    static const char *const WHAT[]  = {"mean", "min", "max", "content", "error", "source", "bodies", "covered"};
    const ScalarBalance     *b       = &scalar[i].balance;
    const PetscReal          value[] = {b->mean,         b->min,    b->max,   b->content,
                                        scalar[i].error, b->source, b->nodes, scalar[i].covered};

    for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(WHAT); k++) {
      char name[NAME];

      PetscCall(PetscSNPrintf(name, sizeof(name), "scalar_%s_%s", WHAT[k], scalar[i].par->name));
      PetscCall((*put)(ctx, name, value[k]));
    }
    if (scalar[i].par->periodic_gradient) {
      char name[NAME];

      PetscCall(PetscSNPrintf(name, sizeof(name), "scalar_effective_%s", scalar[i].par->name));
      PetscCall((*put)(ctx, name, b->effective));
    }
    PetscCall(put_boundaries(scalar + i, mesh, put, ctx));
    PetscCall(put_groups(scalar + i, put, ctx));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

typedef struct {
  PetscErrorCode (*add)(void *ctx, const char name[]);
  void *ctx;
} Names;

static PetscErrorCode put_name(void *ctx, const char name[], PetscReal value)
{
  Names *n = (Names *)ctx;

  PetscFunctionBeginUser;
  (void)value;
  PetscCall((*n->add)(n->ctx, name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode put_value(void *ctx, const char name[], PetscReal value)
{
  PetscReal **next = (PetscReal **)ctx;

  PetscFunctionBeginUser;
  (void)name;
  *(*next)++ = value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarColumnsAdd(Couple couple, Mesh mesh, PetscErrorCode (*add)(void *ctx, const char name[]),
                                void *ctx)
{
  Names names = {add, ctx};

  PetscFunctionBeginUser;
  PetscCall(put_all(couple, mesh, put_name, &names));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarColumnsGet(Couple couple, Mesh mesh, PetscReal value[])
{
  PetscFunctionBeginUser;
  PetscCall(put_all(couple, mesh, put_value, &value));
  PetscFunctionReturn(PETSC_SUCCESS);
}
