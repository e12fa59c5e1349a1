//! smoke
use cao::renderer::*; use cao::volume; use cao::transfer::TransferFunction; use cao::view::*; use cao::picture::Picture; use cao::clip::*; use cao::stage::eyes::Look;
fn main(){
  let gpu=cao::gpu::Gpu::open(&cao::gpu::OpenOptions{device:None,validation:std::env::var("V").is_ok()}).unwrap();
  println!("{}",gpu.info().name);
  let a: Vec<String>=std::env::args().collect();
  let v=volume::open(&a[1]).unwrap();
  let tf=TransferFunction::preset("auto",v.range()).unwrap();
  let mut s=Setup::paper(v.min_spacing());
  if std::env::var("ALL").is_ok(){ s.scope=cao::stage::lao::Scope::All; }
  let t=std::time::Instant::now();
  let mut r=Renderer::new(&gpu,&v,tf,s,COLOUR).unwrap();
  println!("new {:?}",t.elapsed());
  let size=v.size_mm();
  r.set_clips(&[Clip{shape:Shape::Sphere,mode:Mode::Remove,pose:Pose{translate_mm:glam::Vec3::new(0.3*size[0] as f32,-0.3*size[1] as f32,0.3*size[2] as f32),scale:glam::Vec3::splat(0.3*size[0] as f32),..Pose::default()}}]).unwrap();
  println!("{:?}",r.update(&mut |_|()).unwrap());
  println!("{:?}",r.categories().unwrap());
  println!("{:?}",r.verify(&mut |_|()).unwrap());
  let rig=StereoRig::framing(size,30.0,25.0);
  let d=(rig.position).length();
  let views=rig.views(1.0,d*0.01,d*3.0).unwrap();
  let (img,t)=r.draw(&views,&Look::default(),[512,512]).unwrap();
  println!("{:?}",t);
  let p=|e:usize|Picture::over(512,512,&img.colour[e],[0.01;3]);
  Picture::beside(&p(0),&p(1)).write_png(std::path::Path::new("/tmp/smoke.png")).unwrap();
  let mut rnd=cao::measure::random::Random::new(1);
  println!("{:?}",cao::measure::exactness::compare_eyes(&r,&mut rnd).unwrap());
  println!("{:?}",gpu.validation_messages());
}
