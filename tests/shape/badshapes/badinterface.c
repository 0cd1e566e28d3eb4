/* Built for an interface that never existed: must be refused before any of its functions is called. */
#include "shape.h"

TUMBLE_SHAPE_REGISTER = {.interface = SHAPE_INTERFACE + 1000, .type = "badinterface", .dims = 3};
