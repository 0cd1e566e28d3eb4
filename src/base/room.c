/* Room: see room.h. */
#include "compat.h"
#include "base/room.h"
#include <stdarg.h>

PetscErrorCode RoomFor(PetscInt n, PetscInt *room, ...)
{
  va_list arrays;

  PetscFunctionBeginUser;
  if (n <= *room) PetscFunctionReturn(PETSC_SUCCESS);
  *room = 2 * n + 64;
  va_start(arrays, room);
  for (void *array; (array = va_arg(arrays, void *));) {
    const size_t size = va_arg(arrays, size_t);

    PetscCall(PetscRealloc((size_t)*room * size, array));
  }
  va_end(arrays);
  PetscFunctionReturn(PETSC_SUCCESS);
}
