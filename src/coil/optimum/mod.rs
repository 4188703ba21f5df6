//! The coil of equation 11.
pub mod air;
pub mod axis_gradient;
pub mod branch;
pub mod diagnosis;
pub mod domain;
pub mod enclosure;
pub mod model;
pub mod outcome;
pub mod problem;
pub mod scalar;
pub mod search;
pub mod sequential;
pub mod starts;
pub mod valley;
pub mod wound;
#[cfg(test)]
mod probe {
    use super::air::*; use super::problem::*; use super::model::*; use super::search::*;
    use crate::design::*; use crate::field::magnet::MagnetRule; use crate::progress::Silent;
    fn run(name:&str, d:f64, h:f64, limits:Limits, fixed:Fixed, v:Option<f64>) {
        let wire = Wire{diameter_m:d,conductor_diameter_m:d,resistivity_ohm_m:1.68e-8,temperature_c:20.0,choices_m:vec![]};
        let air = AirCoil::new(h,&MagnetRule::dipole([0.0,0.0,-0.90941])).unwrap();
        let task = Task{limits,fixed,current_max_a:2.0,voltage_v:v,strands:Strand::choices(&wire)};
        let t=std::time::Instant::now();
        let o = optimise(&air,&task,&Settings{valley:false,cells:0,..Settings::default()},&Silent).unwrap();
        let t1=t.elapsed(); let t=std::time::Instant::now();
        let o2 = optimise(&air,&task,&Settings{cells:400000,..Settings::default()},&Silent).unwrap();
        println!("== {name}: {:?} {:?}\n   {:?} eval {} starts {} local {t1:?} all {:?} valley {:?}", o.status, o.best.as_ref().map(|b|(b.window,b.force_n,b.turns)), o2.certificate, o.evaluations,o.starts,t.elapsed(), o2.valley_m);
        let t=std::time::Instant::now();
        let wo = super::wound::optimise_wound(&air,&task,&Settings{cells:400000,..Settings::default()},&Silent).unwrap();
        println!("   WOUND {:?} {:?} alt {} {:?} in {:?}", wo.best.as_ref().map(|b|(b.layers,b.turns_per_layer,b.window.inner_radius_m*2e3,b.force_n,b.power_w)), wo.certificate, wo.alternatives.len(), wo.alternatives.iter().take(3).map(|b|(b.layers,b.turns_per_layer,b.force_n)).collect::<Vec<_>>(), t.elapsed());
        if let Some(b)=o2.best { for l in b.limits { if l.active {println!("     {} {} {} {}", l.name.key(), l.value,l.limit,l.sensitivity_n_per_unit);} } }
    }
    #[test] fn probe() {
        let seed=Limits{resistance_max_ohm:Some(6.0),settling_max_s:Some(0.1),outer_diameter_max_m:Some(0.038),length_max_m:Some(0.1),..Default::default()};
        let f=Fixed::default();
        run("seed",0.0007,0.03,seed,f,Some(36.0));
        run("seed od50",0.0007,0.03,Limits{outer_diameter_max_m:Some(0.05),..seed},f,Some(36.0));
        run("noset",0.0007,0.03,Limits{settling_max_s:None,..seed},f,Some(36.0));
        run("R only",0.0007,0.03,Limits{resistance_max_ohm:Some(6.0),..Default::default()},f,None);
        run("V only",0.0007,0.03,Limits::default(),f,Some(36.0));
        run("V + R50",0.0007,0.03,Limits{resistance_max_ohm:Some(50.0),..Default::default()},f,Some(36.0));
        run("V + P",0.0007,0.03,Limits{power_max_w:Some(10.0),..seed},f,Some(36.0));
        run("tau10 od50",0.0007,0.03,Limits{settling_max_s:Some(0.01),outer_diameter_max_m:Some(0.05),..seed},f,Some(36.0));
        run("tau only sized",0.0007,0.03,Limits{settling_max_s:Some(0.01),outer_diameter_max_m:Some(0.5),length_max_m:Some(0.5),..Default::default()},f,None);
        run("tau only",0.0007,0.03,Limits{settling_max_s:Some(0.01),..Default::default()},f,None);
        run("thin wire far",0.00005,100.0,Limits{..seed},f,Some(36.0));
        run("unbounded",0.0007,0.03,Limits{length_max_m:Some(0.1),..Default::default()},f,None);
        run("tiny R",0.0007,0.03,Limits{resistance_max_ohm:Some(1e-6),..seed},f,Some(36.0));
        run("contra",0.0007,0.03,Limits{inner_diameter_min_m:Some(0.04),..seed},f,Some(36.0));
        run("fixed bore",0.0007,0.03,seed,Fixed{inner_diameter_m:Some(0.024),..f},Some(36.0));
        run("fixed all",0.0007,0.03,seed,Fixed{inner_diameter_m:Some(0.024),outer_diameter_m:Some(0.038),length_m:Some(0.09)},Some(36.0));
        run("fixed od",0.0007,0.03,seed,Fixed{outer_diameter_m:Some(0.036),..f},Some(36.0));
        run("idmin mass",0.0007,0.03,Limits{inner_diameter_min_m:Some(0.02),mass_max_kg:Some(0.1),..seed},f,Some(36.0));
    }
}
