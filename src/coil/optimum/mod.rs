//! The coil of equation 11.
pub mod air;
pub mod axis_gradient;
pub mod domain;
pub mod model;
pub mod problem;
pub mod sequential;
pub mod starts;
#[cfg(test)]
mod probe {
    use super::*; use super::air::*; use super::problem::*; use super::model::*; use super::domain::*;
    use crate::design::*; use crate::field::magnet::MagnetRule;
    #[test] fn probe() {
        let wire = Wire{diameter_m:0.0007,conductor_diameter_m:0.0007,resistivity_ohm_m:1.68e-8,temperature_c:20.0,choices_m:vec![]};
        let air = AirCoil::new(0.03,&MagnetRule::dipole([0.0,0.0,-0.90941])).unwrap();
        for (od,set) in [(0.038,Some(0.1)),(0.038,None),(0.05,Some(0.1)),(0.05,None),(0.05,Some(0.01)),(0.05,Some(0.005))] {
        let task = Task{limits:Limits{resistance_max_ohm:Some(6.0),settling_max_s:set,outer_diameter_max_m:Some(od),length_max_m:Some(0.1),inner_diameter_min_m:None,..Default::default()},fixed:Fixed::default(),current_max_a:2.0,voltage_v:Some(36.0),strands:Strand::choices(&wire)};
        for p in Problem::of_wire(&air,&task,task.strands[0]) {
            let d = Domain::of(&p);
            println!("{:?} {:?}", p.regime, Domain::contradiction(&p).map(|c|c.message));
            for k in 0..6 { 
                let t=std::time::Instant::now();
                let s = starts::start(&d,0.03,1,k);
                if let Some(l)=sequential::solve(&p,s) {
                 let w=Problem::window(l.x);
                 println!("F {:.9} a1 {:.6} a2 {:.6} l {:.6} viol {:.1e} ev {} lam {:?} {:?}", (-l.point.objective).exp(), w.inner_radius_m*1e3,w.outer_radius_m()*1e3,w.length_m*1e3,l.violation(&p),l.evaluations,l.multipliers.iter().zip(&p.bounds).filter(|(m,_)|**m!=0.0).map(|(m,b)|format!("{}:{:.4}",b.name.key(),m)).collect::<Vec<_>>(), t.elapsed());
                }
            }
        }}
    }
}
