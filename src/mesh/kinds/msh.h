/* Msh: what a Gmsh mesh file says, on one rank and as it stands there: nodes, elements, physical groups.

   Formats 1, 2.x, 4.0 and 4.1 (ASCII, and binary from 2 on) as the reference manual of Gmsh describes them ("File
   formats"). Nothing is judged here: gmsh.c makes a mesh of it. Not collective. */
#pragma once
#include <petscsys.h>

#define MSH_NAME  64
#define MSH_FAULT 512

/* A type of element: its shape in the plural, dimension, nodes, order of its polynomials */
typedef struct {
  const char *shape;
  PetscInt    dim, nnode, order;
} MshType;

typedef struct {
  PetscInt       number, entity; /* of the element, of the point, curve, surface or volume that it belongs to */
  PetscInt       group[2];       /* physical groups, 0: none; of more than two the first ones */
  PetscInt       start;          /* of its nodes in Msh.node */
  const MshType *type;
} MshElement;

typedef struct {
  PetscInt dim, number;
  char     name[MSH_NAME];
} MshGroup;

/* A curve or so: its physical groups (format 4) */
typedef struct {
  PetscInt dim, number, group[2];
} MshEntity;

typedef struct {
  PetscInt    nnode, nelement, ngroup, nentity, nindex;
  PetscReal  *x;    /* [nnode][3] */
  PetscInt   *node; /* [nindex] nodes of the elements, in Gmsh's order */
  MshElement *element;
  MshGroup   *group;  /* those with a name */
  MshEntity  *entity; /* ascending by dimension and number */
  PetscBool   periodic;
  PetscInt   *tag, *index; /* [nnode] numbers of nodes in the file, ascending, and which nodes they are */
  PetscInt    element_capacity, index_capacity, group_capacity, entity_capacity;
} Msh;

/* Read a file; the caller clears it, also after a fault. *fault: "" or what is wrong with it. */
PetscErrorCode MshRead(const char path[], Msh *, char fault[MSH_FAULT]);
PetscErrorCode MshClear(Msh *);
/* Name of a physical group, NULL: it has none */
const char *MshGroupName(const Msh *, PetscInt dim, PetscInt number);
