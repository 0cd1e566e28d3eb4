/* Bodies, columns: the arrays per known body, and records of all of them in which a body goes from rank to rank. */
#include "compat.h"
#include "impl.h"
#include "base/sparse.h"
#include "subdomains.h"

PetscErrorCode BodyAddColumn(Bodies b, size_t bytes, PetscBool stays, void **array)
{
  PetscFunctionBeginUser;
  PetscCheck(b->ncolumns < BODIES_MAX_COLUMNS, PETSC_COMM_SELF, PETSC_ERR_SUP, "Bodies have room for %d arrays",
             BODIES_MAX_COLUMNS);
  b->column[b->ncolumns++] = (BodyColumn){array, bytes, stays};
  PetscCall(PetscCalloc(PetscMax(1, b->capacity) * bytes, array));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Room for n bodies, which is not filled */
static PetscErrorCode reserve_columns(Bodies b, PetscInt n)
{
  PetscFunctionBeginUser;
  if (n <= b->capacity) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < b->ncolumns; i++) {
    BodyColumn *c = b->column + i;

    PetscCall(PetscRealloc((size_t)n * c->bytes, c->array));
  }
  b->capacity = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAttach(Bodies b, size_t bytes, void **array)
{
  PetscFunctionBeginUser;
  PetscCall(BodyAddColumn(b, bytes, PETSC_FALSE, array));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAttachWork(Bodies b, size_t bytes, void **array)
{
  PetscFunctionBeginUser;
  PetscCall(BodyAddColumn(b, bytes, PETSC_TRUE, array));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesDetach(Bodies b, void **array)
{
  PetscInt i = 0;

  PetscFunctionBeginUser;
  while (i < b->ncolumns && b->column[i].array != array) i++;
  if (i == b->ncolumns) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree(*array));
  b->column[i] = b->column[--b->ncolumns];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static size_t sent_bytes(const BodyColumn *c)
{
  return c->stays ? 0 : c->bytes;
}

static size_t record_size(Bodies b)
{
  size_t bytes = 0;

  for (PetscInt i = 0; i < b->ncolumns; i++) bytes += sent_bytes(b->column + i);
  return bytes;
}

static void pack(Bodies b, PetscInt k, char *to)
{
  for (PetscInt i = 0; i < b->ncolumns; to += sent_bytes(b->column + i++))
    (void)PetscMemcpy(to, (char *)*b->column[i].array + (size_t)k * b->column[i].bytes, sent_bytes(b->column + i));
}

static void unpack(Bodies b, const char *from, PetscInt k)
{
  for (PetscInt i = 0; i < b->ncolumns; from += sent_bytes(b->column + i++))
    (void)PetscMemcpy((char *)*b->column[i].array + (size_t)k * b->column[i].bytes, from, sent_bytes(b->column + i));
}

static void move_body(Bodies b, PetscInt from, PetscInt to)
{
  for (PetscInt i = 0; i < b->ncolumns && from != to; i++) {
    const BodyColumn *c = b->column + i;

    (void)PetscMemcpy((char *)*c->array + (size_t)to * c->bytes, (char *)*c->array + (size_t)from * c->bytes,
                      sent_bytes(c));
  }
}

void BodyKeep(Bodies b, const PetscBool keep[])
{
  PetscInt n = 0;

  for (PetscInt k = 0; k < b->state.n; k++)
    if (keep[k]) move_body(b, k, n++);
  b->state.n = n;
}

PetscErrorCode BodyJoin(Bodies b, PetscInt m, const char *record, PetscBool own, const PetscMPIInt from[])
{
  const size_t bytes = record_size(b);
  BodyArrays  *s     = &b->state;
  PetscInt    *number, *order, i = s->n - 1;

  PetscFunctionBeginUser;
  if (s->n + m > b->capacity) PetscCall(reserve_columns(b, s->n + m + (s->n + m) / 16));
  PetscCall(PetscMalloc2(m, &number, m, &order));
  for (PetscInt j = 0, at = 0; at < b->ncolumns && j < m; j++) { /* where the number stands in a record */
    size_t offset = 0;

    for (at = 0; b->column[at].array != (void **)&s->number; at++) offset += sent_bytes(b->column + at);
    PetscCall(PetscMemcpy(number + j, record + (size_t)j * bytes + offset, sizeof(PetscInt)));
    order[j] = j;
  }
  PetscCall(PetscSortIntWithArray(m, number, order));
  for (PetscInt j = m - 1, at = s->n + m - 1; j >= 0; at--) {
    if (i >= 0 && s->number[i] > number[j]) move_body(b, i--, at);
    else {
      unpack(b, record + (size_t)order[j] * bytes, at);
      s->own[at]   = own;
      b->owner[at] = from[order[j]];
      j--;
    }
  }
  s->n += m;
  PetscCall(PetscFree2(number, order));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesExchange(Bodies b, PetscInt n, const PetscMPIInt to[], size_t bytes, const void *out,
                              PetscInt *comes, void *in, PetscMPIInt **from)
{
  PetscFunctionBeginUser;
  PetscCall(SparseExchange(b->subdomains->comm, b->subdomains->tag, n, to, bytes, out, comes, in, from));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyExchange(Bodies b, PetscInt n, PetscMPIInt to[], PetscInt body[], PetscInt *comes, char **in,
                            PetscMPIInt **from)
{
  const size_t bytes = record_size(b);
  char        *out;

  PetscFunctionBeginUser;
  PetscCall(PetscSortMPIIntWithIntArray((PetscMPIInt)n, to, body));
  PetscCall(PetscMalloc1((size_t)n * bytes, &out));
  for (PetscInt i = 0; i < n; i++) pack(b, body[i], out + (size_t)i * bytes);
  PetscCall(BodiesExchange(b, n, to, bytes, out, comes, in, from));
  PetscCall(PetscFree(out));
  PetscFunctionReturn(PETSC_SUCCESS);
}
