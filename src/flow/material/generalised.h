/* Generalised: what a generalised Newtonian fluid keeps; for generalised.c and extend.c only. */
#pragma once
#include "../impl.h"
#include "rheology.h"

typedef struct _p_Extension *Extension;

typedef struct {
  Rheology  law;
  Extension extension; /* cut cells, NULL: nobody said */
} Generalised;

/* NULL: the fluid is another one */
Generalised *FlowGeneralised(const struct _p_Flow *);
/* The viscosity in cut cells becomes that of the fluid next to them (extend.c); of FlowSetCutCells. Collective. */
void           ExtensionKeepRates(Flow); /* f->viscosity.mu are rates of strain now: those of cut cells are kept */
PetscErrorCode ExtensionApply(Flow);
PetscBool      ExtensionHas(Extension, PetscInt c);
PetscErrorCode ExtensionDestroy(Extension *);
