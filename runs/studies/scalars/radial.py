import numpy as np, sys
def radial(kf=.01,cf=1,ks=.1,cs=3,a=.25,R=1.0,T=1.0,n=4000,nt=4000,dim=2,T0=lambda r:np.exp(-r*r/.09)):
    # finite volume on cells aligned with a
    h=R/n; na=round(a/h); assert abs(na*h-a)<1e-12
    rf=np.arange(n+1)*h; rc=rf[:-1]+h/2
    k=np.where(np.arange(n)<na,ks,kf); c=np.where(np.arange(n)<na,cs,cf)
    g=np.zeros(n+1); g[1:-1]=rf[1:-1]**(dim-1)*2*k[1:]*k[:-1]/(k[1:]+k[:-1])/h
    V=(rf[1:]**dim-rf[:-1]**dim)/dim
    from scipy.linalg import solve_banded
    dt=T/nt; u=T0(rc)
    def ab(th):
        A=np.zeros((3,n)); A[1]=V*c/dt+th*(g[:-1]+g[1:]); A[0,1:]=-th*g[1:-1]; A[2,:-1]=-th*g[1:-1]; return A
    for i in range(nt):
        th=1.0 if i<4 else .5
        f=np.zeros(n); d=g[1:-1]*(u[1:]-u[:-1]); f[:-1]+=d; f[1:]-=d
        u=solve_banded((1,1),ab(th),V*c/dt*u+(1-th)*f)
    return rc,u,V,c,na
if __name__=="__main__":
    for T in (.5,1.):
        rc,u,V,c,na=radial(T=T)
        print(T,"centre",u[0],"body mean",(u*V)[:na].sum()/V[:na].sum(), "surface",.5*(u[na]+u[na-1]), "total",(u*V*c).sum()*2*np.pi)
